"""Columns of ``Run.bodies`` and ``State.fixed``. Those of links and fixed bodies are of the origin of their frame instead of the center of mass."""

POSITION = slice(0, 3)
"""Center of mass, world frame [m]."""
QUATERNION = slice(3, 7)
"""Turn of the body's frame against the world's, x, y, z, w, of length 1."""
VELOCITY = slice(7, 10)
"""Of the center of mass, world frame [m/s]."""
ANGULAR_VELOCITY = slice(10, 13)
"""World frame [rad/s]."""
