// Hand and object in three dimensions. All is in camera coordinates: x right, y down, z forward [m].

/** Colors of distances to the hand [mm]; what is farther has no color of its own. */
const DISTANCE = [[-3, [0.55, 0, 0.55]], [-1, [0.85, 0.1, 0.35]], [0, [1, 0.35, 0.1]], [1, [1, 0.85, 0.2]], [5, [0.72, 0.74, 0.77]]];

const VERTEX = `#version 300 es
uniform mat4 clip; uniform mat4 place; uniform mat4 view;
layout(location = 0) in vec3 position; layout(location = 1) in vec3 color;
out vec3 seen; out vec3 tint;
void main() {
  vec4 at = place * vec4(position, 1.0);
  seen = (view * at).xyz; tint = color; gl_Position = clip * at;
}`;
// Normals are those of faces. Both sides are lit: parts of hands are cut open where they are simplified.
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 paint; uniform float flat_color;
in vec3 seen; in vec3 tint; out vec4 pixel;
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float light = 0.35 + 0.65 * abs(dot(normal, normalize(vec3(0.25, 0.4, 1.0))));
  vec3 color = mix(tint, paint.rgb, min(flat_color, 1.0));
  // Lines have no normal.
  pixel = vec4(color * (flat_color > 1.5 ? 1.0 : light) * paint.a, paint.a);
}`;

/** Column-major product of two 4×4 matrices. */
function product(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

/** A 4×4 matrix, by columns, of three rows of four. */
const columns = (m) => new Float32Array([m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, m[3], m[7], m[11], 1]);
const IDENTITY = columns([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);

function decodeMesh(mesh) {
  const colors = Float32Array.from(bytesOf(mesh.colors), (c) => c / 255);
  return { positions: new Float32Array(bytesOf(mesh.positions).buffer), colors, faces: new Uint16Array(bytesOf(mesh.faces).buffer) };
}

/** Diagonal of the bounding box of points. */
function diagonal(positions) {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  positions.forEach((v, k) => {
    low[k % 3] = Math.min(low[k % 3], v);
    high[k % 3] = Math.max(high[k % 3], v);
  });
  return norm(minus(high, low));
}

/** A sphere of radius one. */
function ball(rows = 12, segments = 24) {
  const [positions, faces] = [[], []];
  for (let i = 0; i <= rows; i++) {
    for (let k = 0; k < segments; k++) {
      const [polar, turn] = [(Math.PI * i) / rows, (2 * Math.PI * k) / segments];
      positions.push(Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar));
      const [a, b] = [i * segments + k, i * segments + ((k + 1) % segments)];
      if (i < rows) faces.push(a, a + segments, b, b, a + segments, b + segments);
    }
  }
  return { positions: new Float32Array(positions), colors: new Float32Array(positions.length).fill(0.5), faces: new Uint16Array(faces) };
}

/** One canvas for all frames: browsers allow few contexts. */
class SceneView {
  constructor(data) {
    this.data = data;
    this.canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": "hand and object; arrow keys turn the view" });
    const gl = this.canvas.getContext("webgl2", { antialias: true, premultipliedAlpha: true });
    this.gl = gl;
    if (!gl) return;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = Object.fromEntries(["clip", "place", "view", "paint", "flat_color"].map((n) => [n, gl.getUniformLocation(program, n)]));
    this.meshes = new Map();
    this.ball = this.upload(ball());
    this.shows = { hand: true, object: true, initial: true, distance: true, ellipsoid: true, forces: true };
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /** Buffers of a mesh. */
  upload({ positions, colors, faces }) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const buffer = (place, values) => {
      const made = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, made);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
      return made;
    };
    const positionBuffer = buffer(0, positions);
    const colorBuffer = buffer(1, colors);
    if (faces) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    }
    return { array, positionBuffer, colorBuffer, colors, diagonal: diagonal(positions), count: faces ? faces.length : positions.length / 3 };
  }

  /** Frees what was uploaded without faces. */
  discard(mesh) {
    if (!mesh) return;
    this.gl.deleteVertexArray(mesh.array);
    this.gl.deleteBuffer(mesh.positionBuffer);
    this.gl.deleteBuffer(mesh.colorBuffer);
  }

  mesh(index) {
    if (!this.meshes.has(index)) this.meshes.set(index, this.upload(decodeMesh(this.data.meshes[index])));
    return this.meshes.get(index);
  }

  /** Turns to the scene of a frame. */
  show(scene) {
    const same = this.scene?.object === scene.object;
    this.scene = scene;
    const axes = scene.ellipsoid && [0, 3, 6].map((k) => scene.ellipsoid.slice(k, k + 3));
    // An accurate pose has an ellipsoid that nobody would see.
    const longest = axes ? 3 * Math.max(...axes.map(norm)) : 0;
    this.magnified = longest > 0 ? [1, 10, 100].find((m) => m * longest >= 4e-3) ?? 100 : 1;
    if (axes) {
      const [a, b, c] = axes.map((axis) => scaled(axis, 3 * this.magnified));
      const o = scene.center;
      this.ellipsoid = columns([a[0], b[0], c[0], o[0], a[1], b[1], c[1], o[1], a[2], b[2], c[2], o[2]]);
    }
    const hand = scene.hand === null ? null : this.data.hands[scene.hand];
    this.discard(this.arrows);
    this.arrows = hand && this.forceLines(hand, scene);
    // Who has turned one frame looks at the next from there, too.
    if (same) this.draw();
    else this.reset();
  }

  /** Lines from taxels along the forces that press the skin, 10 mm for 1 N. */
  forceLines(hand, scene) {
    const ends = [];
    hand.taxels.forEach((taxel, k) => {
      const force = scene.forces[k];
      if (!Array.isArray(force) || norm(force) < 0.02) return;
      const link = scene.links[taxel.link];
      const moved = (p) => [0, 1, 2].map((r) => dot(link.slice(4 * r, 4 * r + 3), p) + link[4 * r + 3]);
      ends.push(...moved(minus(taxel.position, scaled(force, 0.01))), ...moved(taxel.position));
    });
    if (!ends.length) return null;
    return this.upload({ positions: new Float32Array(ends), colors: new Float32Array(ends.length) });
  }

  /** Looks from the camera. */
  reset() {
    this.turn = 0;
    this.tilt = 0;
    // The object and the fingers around it fill the view.
    this.distance = Math.max(0.16, 1.2 * this.mesh(this.scene.object).diagonal);
    this.draw();
  }

  /** Where the viewer stands: right, down, forward as rows, and its place. */
  viewpoint() {
    const { center } = this.scene;
    const forward0 = unit(center);
    // A camera that looks up or down has the picture's up.
    const up = Math.abs(dot(forward0, this.scene.up)) > 0.95 ? unit(cross(cross(forward0, [0, -1, 0]), forward0)) : this.scene.up;
    const right0 = unit(cross(forward0, up));
    const level = unit(cross(up, right0));
    // Angles about the vertical, and above the horizon.
    const height = Math.asin(Math.max(-1, Math.min(1, dot(forward0, up))));
    this.tilt = Math.max(height - 1.55, Math.min(height + 1.55, this.tilt));
    const bounded = height - this.tilt;
    const heading = plus(scaled(level, Math.cos(this.turn)), scaled(right0, Math.sin(this.turn)));
    const forward = plus(scaled(heading, Math.cos(bounded)), scaled(up, Math.sin(bounded)));
    const right = unit(cross(forward, up));
    const down = cross(forward, right);
    return { right, down, forward, eye: minus(center, scaled(forward, this.distance)) };
  }

  draw() {
    const { gl, canvas, scene } = this;
    if (!gl || !scene || this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((s) => Math.max(1, Math.round(s * ratio)));
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      const { right, down, forward, eye } = this.viewpoint();
      const [up, back] = [scaled(down, -1), scaled(forward, -1)];
      const row = (axis) => [...axis, -dot(axis, eye)];
      const view = columns([...row(right), ...row(up), ...row(back)]);
      const [near, far, focal] = [0.02, 5, 1.9];
      const lens = new Float32Array([
        (focal * height) / width, 0, 0, 0, 0, focal, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, (2 * near * far) / (near - far), 0,
      ]);
      gl.uniformMatrix4fv(this.at.clip, false, product(lens, view));
      gl.uniformMatrix4fv(this.at.view, false, view);
      this.drawBodies();
    });
  }

  drawBodies() {
    const { gl, scene, shows } = this;
    const one = (mesh, place, paint, flat, mode = gl.TRIANGLES) => {
      gl.bindVertexArray(mesh.array);
      gl.uniformMatrix4fv(this.at.place, false, place);
      gl.uniform4fv(this.at.paint, paint);
      gl.uniform1f(this.at.flat_color, flat);
      gl.depthMask(paint[3] === 1);
      if (mode === gl.LINES) gl.drawArrays(mode, 0, mesh.count);
      else gl.drawElements(mode, mesh.count, gl.UNSIGNED_SHORT, 0);
      gl.depthMask(true);
    };
    const hand = shows.hand && scene.hand !== null ? this.data.hands[scene.hand].parts : [];
    const object = this.mesh(scene.object);
    if (shows.object) {
      this.paintObject(object);
      one(object, columns(scene.pose), [1, 1, 1, 1], 0);
    }
    // Through a transparent hand the contact is seen.
    const handPaint = shows.distance && shows.object ? [0.5, 0.57, 0.66, 0.3] : [0.5, 0.57, 0.66, 1];
    for (const [link, mesh] of hand) one(this.mesh(mesh), columns(scene.links[link]), handPaint, 1);
    if (shows.forces && this.arrows) {
      gl.disable(gl.DEPTH_TEST);
      one(this.arrows, IDENTITY, [0.1, 0.45, 0.95, 1], 2, gl.LINES);
      gl.enable(gl.DEPTH_TEST);
    }
    if (shows.initial && scene.initial) one(object, columns(scene.initial), [0.85, 0.22, 0.17, 0.22], 1);
    if (shows.ellipsoid && scene.ellipsoid) {
      gl.disable(gl.DEPTH_TEST);
      one(this.ball, this.ellipsoid, [0.15, 0.3, 0.95, 0.55], 1);
      gl.enable(gl.DEPTH_TEST);
    }
  }

  /** Gives the object its own colors, or those of its distance to the hand. */
  paintObject(object) {
    const { gl, scene, shows } = this;
    const key = shows.distance && scene.distances ? scene.distances : "own";
    if (object.painted === key) return;
    object.painted = key;
    let colors = object.colors;
    if (key !== "own") {
      colors = new Float32Array(object.colors.length);
      new Int8Array(bytesOf(scene.distances).buffer).forEach((d, k) => {
        const millimeters = 1e3 * scene.distance_unit * d;
        const own = [0, 1, 2].map((i) => 0.55 + 0.35 * object.colors[3 * k + i]);
        colors.set(millimeters < 5 ? between(DISTANCE, millimeters) : own, 3 * k);
      });
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, object.colorBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, colors, gl.DYNAMIC_DRAW);
  }

  rotate(x, y) {
    this.turn -= x;
    this.tilt -= y;
    this.draw();
  }

  zoom(factor) {
    this.distance = Math.max(0.06, Math.min(2, this.distance * factor));
    this.draw();
  }

  listen() {
    const canvas = this.canvas;
    const held = new Map();
    const apart = () => {
      const [a, b] = [...held.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    canvas.addEventListener("pointerdown", (e) => {
      held.set(e.pointerId, [e.clientX, e.clientY]);
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      const last = held.get(e.pointerId);
      if (!last) return;
      const before = held.size === 2 ? apart() : 0;
      held.set(e.pointerId, [e.clientX, e.clientY]);
      if (held.size === 2) this.zoom(before / Math.max(apart(), 1));
      else this.rotate((e.clientX - last[0]) * 0.008, (e.clientY - last[1]) * 0.008);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => held.delete(e.pointerId));
    // The page scrolls over a view that nobody has touched.
    canvas.addEventListener("wheel", (e) => {
      if (document.activeElement !== canvas) return;
      e.preventDefault();
      this.zoom(Math.exp(e.deltaY * 1e-3));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.reset());
    const steps = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
    canvas.addEventListener("keydown", (e) => {
      if (steps[e.key]) this.rotate(...steps[e.key]);
      else if (e.key === "+" || e.key === "=") this.zoom(0.85);
      else if (e.key === "-") this.zoom(1 / 0.85);
      else if (e.key === "0") this.reset();
      else return;
      e.preventDefault();
      e.stopPropagation();
    });
  }

  /** The view of a frame with its switches and legends. */
  card(scene) {
    const heading = el("h3", {}, "Hand and object");
    if (!this.gl) return el("section.card", {}, heading, el("p.faint", {}, "This browser draws nothing in three dimensions (no WebGL 2)."));
    const toggles = [
      ["object", "object", true], ["hand", "hand", scene.hand !== null], ["distance", "distance to the hand", scene.distances !== null],
      ["initial", "initial pose", scene.initial !== null], ["ellipsoid", "ellipsoid", scene.ellipsoid !== null], ["forces", "forces", scene.forces.length > 0],
    ].filter(([, , there]) => there);
    const button = ([key, name]) => {
      const made = el("button", { "aria-pressed": String(this.shows[key]), click: () => {
        this.shows[key] = !this.shows[key];
        made.setAttribute("aria-pressed", String(this.shows[key]));
        this.draw();
      } }, name);
      return made;
    };
    this.show(scene);
    const notes = [];
    if (scene.distances) notes.push(el("div.scale", {}, "−3 mm (inside)", strip(DISTANCE), "5 mm"));
    if (scene.ellipsoid) {
      const times = this.magnified > 1 ? `, drawn ${this.magnified} times as large` : "";
      notes.push(el("div.scale", {}, `ellipsoid: 3 σ of the object's center${times}`));
    }
    if (this.arrows) notes.push(el("div.scale", {}, "blue: forces on the skin, 10 mm for 1 N"));
    return el("section.card.view", {}, heading, el("div.buttons", {}, ...toggles.map(button)), this.canvas, ...notes);
  }
}
