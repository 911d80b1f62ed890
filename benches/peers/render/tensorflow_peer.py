"""TensorFlow Graphics, rasterize-then-splat on its CPU backend (Python 3.9): the argument is the number of layers.

`pip install tensorflow==2.7.4 'protobuf<3.21' 'numpy<1.23' six`, then `pip install --no-deps tensorflow-graphics`.
"""

import os
import sys

os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"

import numpy as np
import tensorflow as tf
from tensorflow_graphics.rendering.splat import rasterize_then_splat

import peer

LAYERS = int(sys.argv[1])
NEAR, FAR = 0.1, 2.0


class Splat:
    def __init__(self, scene):
        self.scene = scene
        self.placed = tf.constant(scene.placed, tf.float32)
        # Rows of the picture go along y here, which mirrors what the library takes for outside.
        faces = tf.constant(scene.faces[:, ::-1].astype(np.int32))
        opaque = np.ones((len(scene.colors), 1), np.float32)
        colors = tf.constant(np.concatenate([scene.colors, opaque], 1))
        across, down = 2 * scene.focal / scene.width, 2 * scene.focal / scene.height
        depth, shift = (FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
        lens = tf.constant(
            [[across, 0, 0, 0], [0, down, 0, 0], [0, 0, depth, shift], [0, 0, 1, 0]], tf.float32
        )
        target = tf.constant(scene.target())

        def render(placed):
            picture = rasterize_then_splat(
                placed[None],
                faces,
                {"color": colors[None]},
                lens[None],
                (scene.height, scene.width),
                lambda seen: seen["color"],
                num_layers=LAYERS,
            )
            return picture[0, ..., :3]

        def loss(placed):
            return tf.reduce_mean((render(placed) - target) ** 2)

        def gradient(placed):
            with tf.GradientTape() as tape:
                tape.watch(placed)
                value = loss(placed)
            return tape.gradient(value, placed)

        self.drawn, self.loss, self.slope = map(tf.function, (render, loss, gradient))

    def picture(self, seed):
        return self.drawn(self.placed).numpy()

    def value(self, seed):
        return float(self.loss(self.placed))

    def gradient(self, seed):
        return self.scene.twist(self.slope(self.placed).numpy().astype(float))


peer.serve(Splat)
