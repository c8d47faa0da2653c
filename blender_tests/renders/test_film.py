# SPDX-License-Identifier: GPL-3.0-or-later
"""What the film shows of a scene: transparency, holdout, overrides, view layers, crop, scale, aspect, shift."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.pictures import Picture, read, relative_mse  # noqa: E402
from blender_tests.scenes import build, cornell, rendering, target  # noqa: E402

RENDER = {"voxels": 16, "samples": 4, "use_indirect": False}


def render(size: tuple[int, int] | None = None) -> Picture:
    return rendering.conelight(size, **RENDER)


def at(picture: Picture, x: float, y: float) -> Any:
    """The pixel that shows the point (x, y, 0) of the target, as seen by the orthographic camera."""
    height, width = picture.shape[:2]
    scale = width / target.METRES_ACROSS
    return picture[int(height / 2 - y * scale), int(width / 2 + x * scale)]


def extent(picture: Picture, channel: int) -> tuple[float, float, float, float]:
    """Left, right, top, bottom edge, in pixels with fractions, of where a channel shines."""
    lit = picture[..., channel]
    columns, rows = lit.max(axis=0), lit.max(axis=1)
    x, y = np.flatnonzero(columns > 0.01), np.flatnonzero(rows > 0.01)
    assert len(x) and len(y), "the object is not in the picture"
    return (
        x[0] + 1 - columns[x[0]], x[-1] + columns[x[-1]], y[0] + 1 - rows[y[0]], y[-1] + rows[y[-1]],
    )


def test_orthographic_camera() -> None:
    """Eight metres in 64 pixels: 8 pixels a metre."""
    target.scene()
    picture = render()
    assert at(picture, -2, 0) == pytest.approx([1, 0, 0, 1], abs=1e-3)
    assert at(picture, 0, 0) == pytest.approx([0, 1, 0, 1], abs=1e-3)
    assert at(picture, 2, 0) == pytest.approx([0, 0, 1, 1], abs=1e-3)
    assert at(picture, 1, 0) == pytest.approx([0, 0, 0, 1], abs=1e-3)
    assert extent(picture, 1) == pytest.approx([28, 36, 20, 28], abs=1.0)


def test_transparent_film() -> None:
    scene = target.scene()
    build.set_world((0.5, 0.5, 0.5))
    scene.camera.rotation_euler.z = 0.1  # or all edges lie between pixels
    opaque = render()
    assert at(opaque, 1, 0) == pytest.approx([0.5, 0.5, 0.5, 1], abs=1e-3)
    scene.render.film_transparent = True
    picture = render()
    assert at(picture, 1, 0) == pytest.approx([0, 0, 0, 0], abs=1e-3)
    assert at(picture, 0, 0) == pytest.approx([0, 1, 0, 1], abs=1e-3)
    assert (picture[..., 3] > 0.05).mean() < 0.2
    edge = picture[(picture[..., 3] > 0.05) & (picture[..., 3] < 0.95)]
    assert len(edge), "edges are smooth"
    assert edge[:, :3].sum(axis=1) == pytest.approx(edge[:, 3], abs=1e-3), "colour is multiplied by alpha"


def test_edges_are_as_soft_as_in_cycles() -> None:
    """The pixel filter, of the same name and width."""
    scene = target.scene()
    scene.camera.rotation_euler.z = 0.1
    picture = rendering.conelight(**{**RENDER, "samples": 128})
    assert relative_mse(picture, rendering.cycles(samples=512)) < 0.005


@pytest.mark.parametrize("filter_width", [0.5, 1.5, 4.0])
def test_border_is_a_part_of_the_whole_picture(filter_width: float) -> None:
    """Pixels at its edges take samples from beyond it, as in the whole picture; at the frame's edges there are none."""
    scene = target.scene()
    build.set_world((0.5, 0.5, 0.5))
    scene.camera.rotation_euler.z = 0.1
    scene.render.filter_size = filter_width
    whole = rendering.conelight(**{**RENDER, "samples": 8})
    height, width = whole.shape[:2]
    for left, bottom, right, top in ((0.4375, 0.5, 0.5625, 0.625), (0.0, 0.25, 0.5, 1.0), (0.0, 0.0, 1.0, 0.5)):
        scene.render.use_border = scene.render.use_crop_to_border = True
        scene.render.border_min_x, scene.render.border_max_x = left, right
        scene.render.border_min_y, scene.render.border_max_y = bottom, top
        picture = rendering.conelight(**{**RENDER, "samples": 8})
        rows = slice(round((1 - top) * height), round((1 - bottom) * height))
        part = whole[rows, round(left * width) : round(right * width)]
        assert picture.shape == part.shape
        assert picture == pytest.approx(part, abs=2e-3)


def test_holdout() -> None:
    target.scene()
    bpy.data.objects["Green"].is_holdout = True
    picture = render()
    assert at(picture, 0, 0) == pytest.approx([0, 0, 0, 0], abs=1e-3)
    assert at(picture, 2, 0) == pytest.approx([0, 0, 1, 1], abs=1e-3)


def test_material_override() -> None:
    scene = target.scene()
    scene.view_layers[0].material_override = build.emission("Override", (0.25, 0.5, 0.75))
    picture = render()
    for x in (-2, 0, 2):
        assert at(picture, x, 0) == pytest.approx([0.25, 0.5, 0.75, 1], abs=1e-3)


def test_camera_visibility() -> None:
    target.scene()
    bpy.data.objects["Green"].visible_camera = False
    picture = render()
    assert at(picture, 0, 0) == pytest.approx([0, 0, 0, 1], abs=1e-3)
    assert at(picture, 2, 0) == pytest.approx([0, 0, 1, 1], abs=1e-3)


def test_border_without_and_with_crop() -> None:
    """The region of the whole frame, with the same pixels; without crop, in a frame that is empty elsewhere."""
    scene = target.scene()
    whole = render()
    settings = scene.render
    settings.use_border = True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0.5, 1.0
    settings.use_crop_to_border = True
    part = render()
    assert part.shape == (24, 32, 4)
    # Random numbers belong to pixels of the picture, not of the frame, so that edges may differ by noise: not here.
    assert np.allclose(part, whole[:24, 16:48], atol=1e-3)
    settings.use_crop_to_border = False
    uncropped = render()
    assert uncropped.shape == whole.shape
    assert np.allclose(uncropped[:24, 16:48], whole[:24, 16:48], atol=1e-3)
    assert not uncropped[24:].any() and not uncropped[:, :16].any() and not uncropped[:, 48:].any()


def test_border_of_a_lit_scene() -> None:
    """Light does not depend on what part of the frame is rendered."""
    scene = cornell.scene()
    whole = rendering.conelight((64, 64), voxels=32, samples=64)
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.75
    part = rendering.conelight((64, 64), voxels=32, samples=64)
    assert part[..., :3].mean() == pytest.approx(whole[16:48, 16:48, :3].mean(), rel=0.01)
    difference = np.abs(part - whole[16:48, 16:48])[..., :3].mean()
    assert difference < 0.1 * part[..., :3].mean()


def test_percentage() -> None:
    scene = target.scene()
    scene.render.resolution_percentage = 50
    picture = render()
    assert picture.shape == (24, 32, 4)
    assert extent(picture, 1) == pytest.approx([14, 18, 10, 14], abs=1.0)


def test_pixel_aspect() -> None:
    """Pixels twice as wide as high: the frame is as wide as 128, so everything is half as wide in pixels, not lower."""
    scene = target.scene()
    scene.render.pixel_aspect_x = 2.0
    left, right, top, bottom = extent(render(), 1)
    assert (right - left) * 2 == pytest.approx(bottom - top, abs=1.5)
    assert right - left == pytest.approx(8, abs=1.0)  # the scale belongs to the longer side, which is x


def test_shift() -> None:
    """A shift of 0.25 moves the view by a quarter of the longer side: everything goes 16 pixels the other way."""
    scene = target.scene()
    scene.camera.data.shift_x = 0.25
    scene.camera.data.shift_y = -0.125
    assert extent(render(), 1) == pytest.approx([12, 20, 12, 20], abs=1.0)


def test_perspective_with_shift() -> None:
    """The same with a lens: a square 1 m wide, 5 m away, by a lens as long as the sensor is wide, is 64 / 5 pixels."""
    scene = target.scene()
    scene.camera.data.type = "PERSP"
    scene.camera.data.lens = scene.camera.data.sensor_width
    scene.camera.data.shift_x = 0.25
    half = 0.5 * 64 / 5
    assert extent(render(), 1) == pytest.approx([16 - half, 16 + half, 24 - half, 24 + half], abs=1.0)


@pytest.mark.parametrize(("start", "end"), [(0.1, 4.0), (6.0, 100.0)])
def test_clip_planes(start: float, end: float) -> None:
    scene = target.scene()
    scene.camera.data.clip_start, scene.camera.data.clip_end = start, end
    assert not render()[..., :3].any(), "the squares are 5 m away"


def test_view_layers(tmp_path: Any) -> None:
    """Each layer shows its own collections, in one file."""
    import OpenImageIO as oiio

    scene = target.scene()
    for name in ("Red", "Blue"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.objects.link(bpy.data.objects[name])
        scene.collection.objects.unlink(bpy.data.objects[name])
    first = scene.view_layers[0]
    first.name = "First"
    second = scene.view_layers.new("Second")
    first.layer_collection.children["Blue"].exclude = True
    second.layer_collection.children["Red"].holdout = True
    for layer in (first, second):
        layer.use_pass_z = True
    render()
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    bpy.data.images["Render Result"].save_render(str(tmp_path / "layers.exr"), scene=scene)

    channels: dict[str, np.ndarray] = {}
    path = str(tmp_path / "layers.exr")
    for part in range(oiio.ImageBuf(path).nsubimages):  # Blender 5 writes a part for each pass
        buffer = oiio.ImageBuf(path, part, 0)
        pixels = np.asarray(buffer.get_pixels(oiio.FLOAT))
        channels.update({name: pixels[..., i] for i, name in enumerate(buffer.spec().channelnames)})

    def layer(name: str) -> Picture:
        return np.stack([channels[f"{name}.Combined.{letter}"] for letter in "RGBA"], axis=2)

    assert at(layer("First"), -2, 0) == pytest.approx([1, 0, 0, 1], abs=1e-3)
    assert at(layer("First"), 0, 0) == pytest.approx([0, 1, 0, 1], abs=1e-3)
    assert at(layer("First"), 2, 0) == pytest.approx([0, 0, 0, 1], abs=1e-3)
    assert at(layer("Second"), -2, 0) == pytest.approx([0, 0, 0, 0], abs=1e-3)
    assert at(layer("Second"), 2, 0) == pytest.approx([0, 0, 1, 1], abs=1e-3)
    depth = next(values for name, values in channels.items() if name.startswith("First.Depth"))
    assert at(depth, -2, 0) == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize(
    ("view_transform", "value"),
    # Of linear 0.18. Standard is the sRGB curve, Raw none.
    [("Standard", 1.055 * 0.18 ** (1 / 2.4) - 0.055), ("AgX", 0.459), ("Filmic", 0.498),
     ("Khronos PBR Neutral", 0.408), ("Raw", 0.18)],
)  # fmt: skip
def test_png_follows_the_view_transform(view_transform: str, value: float, tmp_path: Any) -> None:
    scene = build.empty_scene()
    build.add_plane("Grey", 4.0, build.emission("Grey", (0.18, 0.18, 0.18)))
    build.add_camera((0, 0, 2), (0, 0, 0), lens=50.0)
    scene.view_settings.view_transform = view_transform
    picture = render((16, 16))
    assert np.allclose(picture[..., :3], 0.18, rtol=1e-4), "EXR is linear"
    rendering.save(tmp_path / "a.png", file_format="PNG", color_depth="8")
    assert np.allclose(read(tmp_path / "a.png")[..., :3], value, atol=1.5 / 255 + 0.003)
