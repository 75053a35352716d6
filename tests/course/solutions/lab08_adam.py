"""A right answer to this lab, for the tests of its grader."""

import numpy as np


def step(theta, g, m, v, t, learning_rate):
    m = 0.9 * m + (1 - 0.9) * g
    v = 0.999 * v + (1 - 0.999) * g * g
    mean, square = m / (1 - 0.9**t), v / (1 - 0.999**t)
    return theta - learning_rate * mean / (np.sqrt(square) + 1e-8), m, v


def rate(learning_rate, k, steps):
    return learning_rate * (1 + np.cos(np.pi * k / steps)) / 2


def train(theta, gradient, steps, learning_rate):
    m, v = np.zeros_like(theta), np.zeros_like(theta)
    for k in range(steps):
        theta, m, v = step(theta, gradient(theta), m, v, k + 1, rate(learning_rate, k, steps))
    return theta
