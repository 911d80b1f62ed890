"""Writes tests/data/pytorch.safetensors: a small network, its votes for some points, their loss and all derivatives, by PyTorch in double precision.

python3 learn/tests/pytorch.py
"""

import json
import math
import pathlib
import struct

import torch

CHANNELS, VOTE, REWARD = 15, 10, 0.15
SETS, POINTS, VOTERS = 2, 6, 3


def layer(outputs, inputs):
    weight = torch.randn(outputs, inputs, dtype=torch.double) / math.sqrt(inputs)
    return (0.8 * weight).requires_grad_(), (0.1 * torch.randn(outputs, dtype=torch.double)).requires_grad_()


def forward(weights, points):
    """Votes (sets × voters × 10) of points (sets × points × 15)."""
    dense = lambda name, x: x @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]
    local = torch.relu(dense("point.1", torch.relu(dense("point.0", points))))
    whole = torch.relu(dense("point.2", local)).amax(dim=1)
    whole = torch.relu(dense("global.0", whole))
    both = torch.cat([local[:, :VOTERS], whole[:, None].expand(-1, VOTERS, -1)], dim=2)
    return dense("vote.2", torch.relu(dense("vote.1", torch.relu(dense("vote.0", both)))))


def rotation(vote):
    a, b = vote[..., 3:6], vote[..., 6:9]
    a = torch.nn.functional.normalize(a, dim=-1)
    b = torch.nn.functional.normalize(b - (a * b).sum(-1, keepdim=True) * a, dim=-1)
    return torch.stack([a, b, torch.linalg.cross(a, b)], dim=-1)


def loss(votes, positions, truth_rotation, truth_position, model, turns):
    """DenseFusion: mean of c d − w ln c, d the mean distance of the model's points, after the turn of the least mean squared distance."""
    made = (rotation(votes) @ model.T).transpose(-1, -2) + (positions + votes[..., :3])[..., None, :]
    targets = truth_rotation[:, None] @ turns[None]
    true = (targets @ model.T).transpose(-1, -2) + truth_position[:, None, None, :]
    difference = made[:, :, None] - true[:, None]
    best = (difference**2).sum(-1).mean(-1).argmin(-1)
    distance = difference.norm(dim=-1).mean(-1).gather(2, best[..., None])[..., 0]
    confidence = torch.sigmoid(votes[..., 9])
    return (confidence * distance - REWARD * torch.log(confidence)).mean(), distance.mean()


torch.manual_seed(5)
weights = {}
widths = [("point.0", CHANNELS, 8), ("point.1", 8, 12), ("point.2", 12, 16), ("global.0", 16, 10), ("vote.0", 22, 14), ("vote.1", 14, 11), ("vote.2", 11, VOTE)]
for name, inputs, outputs in widths:
    weights[f"{name}.weight"], weights[f"{name}.bias"] = layer(outputs, inputs)
points = torch.randn(SETS, POINTS, CHANNELS, dtype=torch.double)
half = torch.diag(torch.tensor([-1.0, -1.0, 1.0], dtype=torch.double))
turns = torch.stack([torch.eye(3, dtype=torch.double), half])
# Their sum is zero, as that of points all around an object nearly is.
model = torch.randn(4, 3, dtype=torch.double) * 0.5
model = torch.cat([model, -model])
truth_rotation = torch.linalg.qr(torch.randn(SETS, 3, 3, dtype=torch.double))[0]
truth_rotation = truth_rotation * torch.linalg.det(truth_rotation)[:, None, None]
truth_position = 0.3 * torch.randn(SETS, 3, dtype=torch.double)

votes = forward(weights, points)
votes.retain_grad()
value, distance = loss(votes, points[:, :VOTERS, :3], truth_rotation, truth_position, model, turns)
value.backward()

tensors = {name: w for name, w in weights.items()}
tensors |= {f"gradient.{name}": w.grad for name, w in weights.items()}
tensors |= {"points": points, "votes": votes, "gradient.votes": votes.grad, "loss": value.reshape(1), "distance": distance.reshape(1)}
tensors |= {"turns": turns, "model": model, "truth.rotation": truth_rotation, "truth.position": truth_position}
header, data = {}, b""
for name, tensor in sorted(tensors.items()):
    numbers = tensor.detach().float().flatten().tolist()
    packed = struct.pack(f"<{len(numbers)}f", *numbers)
    header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(data), len(data) + len(packed)]}
    data += packed
text = json.dumps(header).encode()
text += b" " * (-len(text) % 8)
out = pathlib.Path(__file__).parent / "data" / "pytorch.safetensors"
out.write_bytes(struct.pack("<Q", len(text)) + text + data)
print(value.item(), distance.item(), out.stat().st_size)
