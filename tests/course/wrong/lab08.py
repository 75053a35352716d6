"""Wrong answers to lab 8: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "theta - learning_rate * mean": [("theta + learning_rate * mean", "uphill", "against the slope")],
    "m / (1 - 0.9**t), v / (1 - 0.999**t)": [("m, v", "no corrections", "begin at 0")],
    "m / (1 - 0.9**t)": [("m", "m is not corrected", "m begins at 0")],
    "v / (1 - 0.999**t)": [("v", "v is not corrected", "v begins at 0")],
    "(np.sqrt(square) + 1e-8)": [
        ("np.sqrt(square + 1e-8)", "epsilon inside", "outside of the root"),
        ("(square + 1e-8)", "no root", "root of v"),
        ("np.sqrt(square)", "no epsilon", "epsilon is missing"),
    ],
    "m = 0.9 * m + (1 - 0.9) * g\n    v = 0.999 * v + (1 - 0.999) * g * g\n"
    "    mean, square = m / (1 - 0.9**t), v / (1 - 0.999**t)": [
        ("m = 0.999 * m + (1 - 0.999) * g\n    v = 0.9 * v + (1 - 0.9) * g * g\n"
         "    mean, square = m / (1 - 0.999**t), v / (1 - 0.9**t)", "betas exchanged", "beta_1 belongs to m"),
    ],
    "m = 0.9 * m + (1 - 0.9) * g": [
        ("m = 0.9 * m + g", "momentum without 1 - beta", "\\(1 - beta_1\\) times"),
        ("m = 0.9 * g + (1 - 0.9) * m", "turned around", "m keeps beta_1"),
        ("m *= 0.9\n    m = m + (1 - 0.9) * g", "m in place", "an argument is changed"),
    ],
    "(1 - 0.999) * g * g": [
        ("(1 - 0.999) * np.abs(g)", "magnitudes", "mean of squares"),
        ("(1 - 0.999) * g", "no square", "mean of squares|root of a negative"),
        ("(1 - 0.999) * (g - m) ** 2", "around the mean", "not the distance from the mean"),
    ],
    "0.9**t), v / (1 - 0.999**t)": [
        ("0.9), v / (1 - 0.999)", "no power", "power t"),
        ("0.9 ** (t + 1)), v / (1 - 0.999 ** (t + 1))", "t + 1", "not t \\+ 1"),
    ],
    "return theta - learning_rate * mean / (np.sqrt(square) + 1e-8), m, v": [
        ("return theta - learning_rate * mean / (np.sqrt(square) + 1e-8), mean, square",
         "corrected ones are kept", "kept as they are"),
    ],
    "learning_rate * (1 + np.cos(np.pi * k / steps)) / 2": [
        ("learning_rate * (1 + np.cos(np.pi * k / steps))", "twice the rate", "half of 1 \\+ cos"),
        ("learning_rate * np.cos(np.pi * k / steps)", "only a cosine", "below 0"),
        ("learning_rate * (1 - k / steps)", "a line", "not a line"),
        ("(1 + np.cos(np.pi * k / steps)) / 2", "no rate", "times the learning rate"),
    ],
    "(1 + np.cos(np.pi * k / steps))": [("(1 - np.cos(np.pi * k / steps))", "it rises", "it falls")],
    "np.cos(np.pi * k / steps)": [
        ("np.cos(2 * np.pi * k / steps)", "a whole wave", "half a wave"),
        ("np.cos(np.pi * k / (steps - 1))", "steps - 1", "not k / \\(steps - 1\\)"),
        ("np.cos(np.pi * (k + 1) / steps)", "k from 1", "counted from 0"),
    ],
    "k + 1, rate(learning_rate, k, steps)": [
        ("k + 1, learning_rate", "no decay", "does not fall"),
        ("k, rate(learning_rate, k, steps)", "t from 0", "counted from 1|divisor"),
        ("1, rate(learning_rate, k, steps)", "t is always 1", "from 1 on"),
    ],
    "gradient(theta), m, v, k + 1": [
        ("gradient(theta), 0 * m, 0 * v, k + 1", "no memory", "kept from step to step"),
    ],
    "    for k in range(steps):\n": [
        ("    slope = gradient(theta)\n    gradient = lambda _: slope\n    for k in range(steps):\n",
         "the first slope", "once a step"),
    ],
    "theta, m, v = step(theta, gradient(theta)": [
        ("_, m, v = step(theta, gradient(theta)", "theta is not kept", "not kept"),
    ],
    "range(steps)": [
        ("range(steps - 1)", "one step too few", "once a step"),
        ("range(1, steps)", "begins at 1", "once a step"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
