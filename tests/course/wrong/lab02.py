"""Wrong answers to lab 2: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "np.array(camera.look_at) - position": [
        ("(np.array(camera.look_at) - position).astype(np.float32)", "float32", "single precision"),
        ("position - np.array(camera.look_at)", "looks back", "not back"),
        ("np.array(camera.look_at)", "a point as a direction", "look_at - position"),
    ],
    "np.radians(camera.vertical_fov_deg)": [
        ("camera.vertical_fov_deg * 3.14159 / 180", "a short pi", "few digits"),
    ],
    "forward = unit(np.array(camera.look_at) - position)": [
        ("forward = np.array(camera.look_at) - position", "a long forward",
         "forward is not made a unit vector"),
    ],
    "unit(forward + across": [("unit(across", "forward is not added", "nothing is left of it")],
    "(2 * (x + u) - width) / height": [
        ("(2 * (x + u) - width) // height", "whole coordinates",
         "// and not //|/ and not //|horizontal|middle"),
    ],
    "    position = np.array(": [
        ("    x += u\n    y += v\n    u = v = 0\n    position = np.array(", "an argument is changed",
         "an argument is changed"),
    ],
    "height - 2 * (y + v)": [
        ("2 * (y + v) - height", "up and down", "row 0 is at the top"),
        ("height - 2 * y", "v is left out", "not in the middle|v is left out"),
    ],
    "2 * (x + u) - width": [
        ("width - 2 * (x + u)", "left and right", "left and right"),
        ("2 * x - width", "u is left out", "u is left out"),
        ("(x + u) - width", "a factor of 2", "middle of the image"),
        ("2 * (x + u + 0.5) - width", "half a pixel more", "middle of the image"),
    ],
    "np.cross(forward, camera.up)": [
        ("np.cross(camera.up, forward)", "right is left", "exchanged"),
        ("np.cross(forward, (0, 1, 0))", "a fixed up", "camera.up is not used"),
    ],
    "- width) / height": [("- width) / width", "divided by the width", "spans the height")],
    "(height - 2 * (y + v)) / height": [
        ("(height - 2 * (y + v)) / width", "divided by the width", "spans the height"),
    ],
    "np.radians(camera.vertical_fov_deg) / 2": [("camera.vertical_fov_deg / 2", "degrees", "np.radians")],
    "np.tan(np.radians(camera.vertical_fov_deg) / 2)": [
        ("np.tan(np.radians(camera.vertical_fov_deg))", "the whole angle", "half of the field"),
        ("np.radians(camera.vertical_fov_deg)", "no tangent", "tangent|horizontal"),
    ],
    "return position, unit(": [
        ("return np.array(camera.look_at), unit(", "begins at look_at", "camera.position"),
        ("return unit(", "no origin", "return both"),
    ],
    "return position, unit(forward + across * right + upwards * up)": [
        ("return position, forward + across * right + upwards * up", "no unit vector",
         "divided by its length"),
        ("position, unit(forward + across * right + upwards * up)", "no return", "no `return`"),
    ],
    "up = np.cross(right, forward)": [
        ("up = np.array(camera.up)", "the world's up", "not the world's up"),
        ("up = np.cross(forward, right)", "down", "exchanged|row 0"),
    ],
    "right = unit(np.cross(forward, camera.up))": [
        ("right = np.cross(forward, camera.up)", "right is not a unit vector", "not made a unit vector"),
    ],
    "2 * (x + u)": [("2 * (x + v)", "u and v exchanged", "exchanged|middle")],
    "axis=-1, keepdims=True)": [("keepdims=True)", "a length over all rays", "axis=-1|over all rays")],
    "/ height * half)[..., None]": [("/ height * half)", "axes that do not fit", "\\[..., None\\]")],
    "forward + across * right + upwards * up": [
        ("forward + across * up + upwards * right", "axes exchanged", "exchanged|right edge|horizontal"),
    ],
    "half = np.tan(": [("half = 2 * np.tan(", "twice the tangent", "factor of 2")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
