# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene files of other programs through scripts/render: the same picture from Conelight as from Cycles."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender_tests.pictures import Picture, bias, read, relative_mse  # noqa: E402
from blender_tests.scenes import build, textured  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
SIZE = ["--resolution", "96x64"]
OURS = [*SIZE, "--voxels", "96", "--samples", "48"]
CYCLES = [*SIZE, "--engine", "cycles", "--samples", "512"]
RELATIVE_MSE = 0.02
BRIGHTNESS = 0.03


def render(scene: str, *options: str, folder: Path) -> tuple[Picture, str]:
    """The picture of scripts/render, and what it says."""
    environment = {**os.environ, "CONELIGHT_TRACEBACK": ""}
    result = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "render"), scene, "-o", "out.exr", *options], cwd=folder, timeout=240,
        capture_output=True, text=True, env=environment, stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    return read(folder / "out.exr"), result.stderr


@pytest.fixture(scope="module")
def usd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene.usda, written by a process of its own: usd-core and Blender both bring a USD library."""
    pytest.importorskip("pxr")
    folder = tmp_path_factory.mktemp("usd")
    writer = ROOT / "blender_tests" / "scenes" / "make_usd.py"
    subprocess.run([sys.executable, str(writer), str(folder)], check=True, timeout=60)
    return folder


@pytest.fixture(scope="module")
def usd_picture(usd: Path) -> Picture:
    picture, said = render("scene.usda", *OURS, "--stats", "stats.json", folder=usd)
    assert "has no camera" not in said and "has no light" not in said
    return picture


def test_usd_holds_what_it_should(usd: Path, usd_picture: Picture) -> None:
    """Three blocks and eight pebbles are in the picture: blue and brass; and the texture's two colours."""
    stats = json.loads((usd / "stats.json").read_text())
    assert {"lights", "world", "glossy"} <= set(stats["features"])
    color = usd_picture[..., :3] / usd_picture[..., :3].sum(axis=2, keepdims=True)
    assert (color[..., 2] > 0.55).mean() > 0.01, "blue blocks"
    assert (color[..., 0] > 0.55).mean() > 0.03, "orange squares, and brass"


def test_usd_is_as_in_cycles(usd: Path, usd_picture: Picture) -> None:
    cycles, _ = render("scene.usda", *CYCLES, folder=usd)
    assert relative_mse(usd_picture, cycles) <= RELATIVE_MSE
    assert abs(bias(usd_picture, cycles)) <= BRIGHTNESS


@pytest.mark.parametrize("extension", ["glb", "obj", "usdc"])
def test_exported_scene(extension: str, tmp_path: Path) -> None:
    """What Blender exports comes back: a textured quad under the neutral world, framed."""
    build.empty_scene()
    material, tree, surface = build.bare_material("Paint")
    bsdf = build.new_node(tree, "BsdfPrincipled", Roughness=1.0)
    image = build.packed_image("Checker", textured.checker_pixels())
    image.save(filepath=str(tmp_path / "checker.png"))
    image = bpy.data.images.load(str(tmp_path / "checker.png"))
    tree.links.new(build.image_node(tree, image).outputs["Color"], bsdf.inputs["Base Color"])
    tree.links.new(bsdf.outputs[0], surface)
    build.add_quad("Board", [(-1, 0, 0), (1, 0, 0), (1, 0, 2), (-1, 0, 2)], material)
    path = str(tmp_path / f"board.{extension}")
    if extension == "glb":
        bpy.ops.export_scene.gltf(filepath=path)
    elif extension == "obj":
        bpy.ops.wm.obj_export(filepath=path, path_mode="COPY")
    else:
        bpy.ops.wm.usd_export(filepath=path)

    picture, said = render(path, *OURS, folder=tmp_path)
    assert "has no camera" in said and "has no light" in said
    cycles, _ = render(path, *CYCLES, folder=tmp_path)
    assert (np.ptp(picture[..., :3], axis=2) > 0.3).mean() > 0.05, "the board has colours"
    assert relative_mse(picture, cycles) <= RELATIVE_MSE
    assert abs(bias(picture, cycles)) <= BRIGHTNESS
