"""The scenes that all renderers draw: three bodies in two sizes of picture, unlit, before black.

Coordinates are those of OpenCV (x right, y down, z forward) in meters; the principal point is the middle of the picture.
"""

import json

import numpy as np

FOCAL = 600.0
SIZES = {"256 x 256": (256, 256), "640 x 480": (640, 480)}
# By which turns count as lengths [m].
ARM = 0.05


def rotation(vector):
    """The matrix of a turn by |vector| about it."""
    vector = np.asarray(vector, float)
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def grid_faces(rows, columns):
    """Triangles between rows of a grid whose columns are closed to a ring."""
    i, j = (a.ravel() for a in np.mgrid[: rows - 1, :columns])
    right = (j + 1) % columns
    a, b, c, d = i * columns + j, i * columns + right, (i + 1) * columns + j, (i + 1) * columns + right
    return np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])


def bottle(sides, rings):
    """A body of revolution with waves of color and a label."""
    outline = [
        (0.0, 0.0), (0.004, 0.030), (0.010, 0.035), (0.120, 0.035), (0.150, 0.016),
        (0.165, 0.0125), (0.1999, 0.0125), (0.2, 0.0),
    ]  # fmt: skip
    height = np.linspace(0, 0.2, rings)[1:-1]
    radius = np.interp(height, *np.transpose(outline))
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = lambda h, r: np.stack([r * np.cos(turn), np.full(sides, h - 0.1), r * np.sin(turn)], 1)
    vertices = np.concatenate([ring(h, r) for h, r in zip(height, radius)] + [[[0, -0.1, 0], [0, 0.1, 0]]])
    bottom, top, last = len(vertices) - 2, len(vertices) - 1, len(vertices) - 2 - sides
    side, following = np.arange(sides), (np.arange(sides) + 1) % sides
    ends = [
        np.stack([np.full(sides, bottom), side, following], 1),
        np.stack([np.full(sides, top), last + following, last + side], 1),
    ]
    faces = np.concatenate([grid_faces(len(height), sides)] + ends)
    around, y = np.arctan2(vertices[:, 2], vertices[:, 0]), vertices[:, 1]
    colors = np.stack(
        [
            0.5 + 0.35 * np.sin(2 * around + 30 * y),
            0.5 + 0.35 * np.sin(around + 1) * np.cos(60 * y),
            0.5 + 0.35 * np.cos(3 * around - 45 * y),
        ],
        1,
    )
    label = np.abs(y) < 0.04
    colors[label] = 0.25 + 0.6 * colors[label]
    return vertices, faces, colors


def square(count):
    """Points on the square of half side 1, `count` a side."""
    along = -1 + 2 * np.arange(count) / count
    one = np.ones(count)
    return np.concatenate(
        [np.stack(p, 1) for p in [(one, along), (-along, one), (-one, -along), (along, -one)]]
    )


def frame(count, half=0.055, section=0.018):
    """A square frame of square section: flat faces, sharp edges and a hole, printed with stripes."""
    corners = square(count)
    rows = [np.insert(corners * (half + section * a), 2, section * b, 1) for a, b in corners]
    vertices = np.concatenate(rows)
    # The last row joins the first.
    faces = grid_faces(len(rows) + 1, len(corners))[:, ::-1] % len(vertices)
    x, y, z = vertices.T
    colors = np.stack(
        [
            0.5 + 0.4 * np.sign(np.sin(150 * x + 40 * z + 0.3)),
            0.5 + 0.35 * np.sin(90 * y - 60 * z),
            0.5 + 0.35 * np.cos(70 * (x + y) + 80 * z),
        ],
        1,
    )
    return vertices, faces, colors


# Name: mesh, turn of the true pose.
BODIES = {
    "bottle, 5 000 faces": (lambda: bottle(50, 52), (0.3, 0.2, 0.85)),
    "bottle, 16 020 faces": (lambda: bottle(90, 91), (0.3, 0.2, 0.85)),
    "frame, 4 608 faces": (lambda: frame(12), (0.5, 0.4, 0.3)),
}


def write(folder, body, size):
    """Writes a scene: `scene.json`, and `mesh.f32` of vertices, colors and faces."""
    make, turn = BODIES[body]
    vertices, faces, colors = make()
    turn, shift = rotation(turn), np.array([0.01, -0.005, 0.6])
    off, by = rotation((0.05, -0.04, 0.06)), np.array([0.006, -0.005, 0.01])
    row_major = lambda turn, shift: np.column_stack([turn, shift]).ravel().tolist()
    width, height = SIZES[size]
    scene = {
        "vertices": len(vertices),
        "faces": len(faces),
        "width": width,
        "height": height,
        "focal": FOCAL,
        "truth": row_major(turn, shift),
        "guess": row_major(off @ turn, shift + by),
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.json").write_text(json.dumps(scene))
    np.concatenate([a.ravel() for a in (vertices, colors, faces)]).astype("<f4").tofile(str(folder / "mesh.f32"))
