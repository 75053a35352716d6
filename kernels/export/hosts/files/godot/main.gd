# The denoiser in Godot 4: a shader on an item that fills a viewport of the pictures' size.
#
# manifest.json says all that differs from model to model. With `godot --path . -- --once` it ends by itself,
# with status 1 if something is wrong. An exported project keeps such files only where its filters for
# resources name them: *.json, *.f32, *.bin.
extends Control

const FORMATS := {1: Image.FORMAT_RF, 2: Image.FORMAT_RGF, 3: Image.FORMAT_RGBF, 4: Image.FORMAT_RGBAF}
const ACROSS := 1024 # weights in a row of their texture


func _ready() -> void:
	var manifest: Dictionary = JSON.parse_string(FileAccess.get_file_as_string("res://manifest.json"))
	var check: Dictionary = manifest["check"]
	var size_of := Vector2i(int(check["width"]), int(check["height"]))
	var material_of := ShaderMaterial.new()
	var kernel: Dictionary = manifest["kernels"][0]
	material_of.shader = load("res://" + str(kernel["files"][0]))
	var first: Texture2D
	for title: String in check["images"]:
		var image: Dictionary = check["images"][title]
		var data := FileAccess.get_file_as_bytes("res://check/" + str(image["file"]))
		var made := textured(data, size_of, FORMATS[int(image["channels"])])
		material_of.set_shader_parameter("image_" + title, made)
		if first == null:
			first = made
	material_of.set_shader_parameter("weight_texture", weights("res://%s/weights.bin" % kernel["role"]))
	var viewport := drawn(material_of, size_of)
	show_beside(first, viewport.get_texture(), size_of)
	for _frame in 2:
		await RenderingServer.frame_post_draw
	var right := judge(viewport.get_texture().get_image(), check, manifest["host"]["storage"]["added"])
	if "--once" in OS.get_cmdline_user_args():
		get_tree().quit(0 if right else 1)


# A texture of numbers: Godot's images have row 0 at the top, as the export's have.
func textured(data: PackedByteArray, size_of: Vector2i, format: Image.Format) -> ImageTexture:
	return ImageTexture.create_from_image(Image.create_from_data(size_of.x, size_of.y, false, format, data))


# The weights as a texture of one number a texel, filled up with zeros.
func weights(path: String) -> ImageTexture:
	var data := FileAccess.get_file_as_bytes(path)
	var rows := ceili(data.size() / (4.0 * ACROSS))
	data.resize(4 * ACROSS * rows)
	return textured(data, Vector2i(ACROSS, rows), Image.FORMAT_RF)


# A viewport that one item with the shader fills. It keeps 8 bits, as a display does.
func drawn(material_of: ShaderMaterial, size_of: Vector2i) -> SubViewport:
	var viewport := SubViewport.new()
	viewport.size = size_of
	viewport.disable_3d = true
	viewport.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	var item := ColorRect.new()
	item.size = Vector2(size_of)
	item.material = material_of
	viewport.add_child(item)
	add_child(viewport)
	return viewport


# The noisy picture, and beside it what the shader has drawn.
func show_beside(noisy: Texture2D, denoised: Texture2D, size_of: Vector2i) -> void:
	var scale_of := mini(int(size.x) / (2 * size_of.x), int(size.y) / size_of.y)
	for at in 2:
		var item := TextureRect.new()
		item.texture = [noisy, denoised][at]
		item.texture_filter = CanvasItem.TEXTURE_FILTER_NEAREST
		item.expand_mode = TextureRect.EXPAND_IGNORE_SIZE
		item.size = Vector2(size_of * maxi(scale_of, 1))
		item.position = Vector2(item.size.x * at, 0)
		add_child(item)


# Whether a picture is the reference's, but for the bound of each number and for 8 bits: NaN is wrong.
func judge(seen: Image, check: Dictionary, added: float) -> bool:
	seen.convert(Image.FORMAT_RGB8)
	var found := seen.get_data()
	var expected := FileAccess.get_file_as_bytes("res://check/output.f32").to_float32_array()
	var bound := FileAccess.get_file_as_bytes("res://check/bound.f32").to_float32_array()
	var wrong := 0
	var worst := 0.0
	var most := 0.0
	for i in expected.size():
		var error := absf(found[i] / 255.0 - expected[i])
		wrong += 0 if error <= bound[i] + added else 1
		worst = maxf(worst, error)
		most = maxf(most, bound[i] + added)
	print("Godot ", Engine.get_version_info()["string"])
	print("largest error %.7f, allowed %.7f; %d of %d numbers are wrong" % [worst, most, wrong, expected.size()])
	var right := wrong == 0 and expected.size() == found.size() and bound.size() == expected.size()
	print("right" if right else "WRONG")
	return right
