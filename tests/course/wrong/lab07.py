"""Wrong answers to lab 7: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "if any(len(b) != len(w) for": [("if any(len(w) == 0 for", "shapes are not checked", "raise ValueError")],
    "(x @ w.T + b) * omegas[min(layer, 1)]": [
        ("x @ w.T * omegas[min(layer, 1)] + b", "omega without the bias", "multiplies the bias too"),
        ("(x @ w.T + b)", "no omega", "omega is missing"),
        ("(x @ w.T + b) * omegas[0]", "the first omega", "the others have omegas\\[1\\]"),
        ("(x @ w.T + b) * omegas[1 - min(layer, 1)]", "omegas exchanged", "omegas\\[0\\] is the first"),
        ("(x @ w.T) * omegas[min(layer, 1)]", "no bias", "bias is missing"),
    ],
    "if layer < len(weights) - 1 else x @ w.T + b": [("", "a sine at the end", "no sine")],
    "else x @ w.T + b": [
        ("else angles[-1]", "omega at the end", "no omega"),
        ("else x @ w.T", "no bias at the end", "layer l takes|bias"),
    ],
    "x = np.sin(angles[-1])": [("x = np.cos(angles[-1])", "a cosine", "sin\\(omega")],
    "x @ w.T + b) *": [("x @ w + b) *", "no transpose", "x @ W.T")],
    "return layers(weights, biases, omegas, x)[0][1:]": [
        ("return layers(weights, biases, omegas, x)[0]", "the input too", "not the input"),
        ("return layers(weights, biases, omegas, x)[0][-1]", "only the last", "values of each layer"),
    ],
    "dy = 2 * error / error.size": [
        ("dy = error / error.size", "half the slope", "factor of 2"),
        ("dy = -2 * error / error.size", "the sign", "y - target"),
        ("dy = 2 * error", "not a mean", "divide by N"),
        ("dy = 2 * error / len(error)", "a mean of examples", "not over the N examples"),
        ("dy = 2 * error / error.shape[1]", "a mean of channels", "D_out channels"),
    ],
    "* np.cos(angles[layer]) * omegas[min(layer, 1)]": [
        ("* np.cos(angles[layer])", "no inner derivative", "inner derivative"),
        ("* np.cos(angles[layer]) * omegas[0]", "the first omega", "own omega"),
        ("* omegas[min(layer, 1)]", "no cosine", "sine is missing"),
    ],
    "np.cos(angles[layer])": [
        ("np.sin(angles[layer])", "a sine", "derivative of sin is cos"),
        ("-np.cos(angles[layer])", "the sign of the cosine", "sign \\+"),
        ("np.cos(values[layer + 1])", "the cosine of the sine", "not its value"),
        ("np.cos(angles[layer] / omegas[min(layer, 1)])", "the argument without omega", "like the sine"),
    ],
    "dbiases.insert(0, dy.sum(axis=0))": [
        ("dbiases.insert(0, dy.mean(axis=0))", "a mean", "takes the sum"),
        ("dbiases.insert(0, dy.sum())", "a sum of all", "shape|axis"),
    ],
    "dweights.insert(0, dy.T @ values[layer])": [
        ("dweights.append(dy.T @ values[layer])", "the order", "first layer of the list"),
        ("dweights.insert(0, values[layer].T @ dy)", "transposed", "dy.T @ x"),
        ("dweights.insert(0, dy.T @ values[layer + 1])", "the next layer's values",
         "dy.T @ x|chain|matmul|first layer"),
    ],
    "        dy = dy @ weights[layer]\n": [("", "no way back", "chain|broadcast|do not fit")],
    "return np.mean(error**2), ": [
        ("return np.sum(error**2), ", "a summed loss", "not the sum"),
        ("return np.mean(error**2) / 2, ", "half the loss", "factor of 1 / 2"),
    ],
    "error = values[-1] - target": [
        ("error = values[-1] - target\n    target += 1", "an argument is changed", "an argument is changed"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
