# SPDX-License-Identifier: GPL-3.0-or-later
"""Every shader that the tests compile is GLSL 4.30 for another compiler too, and keeps to what GL 4.3 promises."""

from __future__ import annotations

import ctypes
import dataclasses
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from addon.gpu import interface, loader
from addon.gpu.context import GpuContext
from addon.gpu.program import resolve
from addon.materials.emit import LEAST_TEXTURES
from addon.materials.graph import ImageData, ImageEncoding, ImageSet, MaterialData, NodeGraph, WorldData
from addon.scene import AreaShape, LightKind, MeshData, SceneData
from blender_tests.material_shader import material, node
from blender_tests.passes import scenes
from blender_tests.passes.conftest import SHADER_VARIANTS
from blender_tests.passes.run import pipeline
from blender_tests.passes.test_film import PASSES, glossy_room

#: What GL 4.3 promises to a compute shader.
STORAGE_BUFFERS, IMAGES, TEXTURES, SHARED_THREADS = 8, 8, 16, 1024


def checker(side: int = 4, encoding: ImageEncoding = ImageEncoding.SRGB) -> ImageSet:
    pixels = np.zeros((side, side, 4), np.uint8)
    pixels[..., 3] = 255
    pixels[(np.add.outer(np.arange(side), np.arange(side)) % 2) == 0, :3] = 255
    return ImageSet("checker", {1001: ImageData("checker", pixels, encoding)})


def textured(count: int) -> MaterialData:
    """A Principled surface with ``count`` images: colour, roughness, normal, alpha, emission."""
    sockets = ("Base Color", "Roughness", "Normal", "Alpha", "Emission Color")
    nodes, inputs = [], {}
    for k, socket in enumerate(sockets[:count]):
        nodes.append(node(f"T{k}", "TexImage", image=checker(encoding=ImageEncoding.DATA if k else ImageEncoding.SRGB)))
        inputs[socket.replace(" ", "_")] = f"T{k}.Color"
    if "Normal" in inputs:
        nodes.append(node("N", "NormalMap", Color="T2.Color", Strength=0.5))
        inputs["Normal"] = "N.Normal"
    if count >= 5:
        inputs["Emission_Strength"] = 2.0
    return material(*nodes, node("P", "BsdfPrincipled", **inputs), surface="P.BSDF", name=f"textured {count}")


def sky_picture() -> WorldData:
    sky = node("T", "TexEnvironment", image=checker(16))
    background = node("B", "Background", Color="T.Color", Strength=2.0)
    output = node("Output", "OutputWorld", Surface="B.Background")
    return WorldData("sky", NodeGraph({n.name: n for n in (sky, background, output)}, "Output"))


def painted(shape: MeshData) -> MeshData:
    colors = np.random.default_rng(0).random((len(shape.corner_normals), 4)).astype(np.float32)
    return dataclasses.replace(shape, color_layers={"Paint": colors}, active_color="Paint")


def everything() -> SceneData:
    """Textures, vertex colours, normal maps, alpha, emission, gloss, all lights, a picture of a sky, a holdout."""
    paint = material(
        node("A", "VertexColor", p_layer_name="Paint"), node("D", "BsdfDiffuse", Color="A.Color"), surface="D.BSDF"
    )
    made = scenes.scene(
        (scenes.plane(3.0), textured(2)), (scenes.plane(1.0), textured(5), scenes.at(0.4, 0.0, 0.6)),
        (painted(scenes.box()), paint, scenes.at(-0.6, 0.4, 0.3, 0.3)),
        (scenes.sphere(0.3, 8), textured(3), scenes.at(0.5, 0.6, 0.4)),
        (scenes.plane(0.3), scenes.principled(0.5, Alpha=0.5), scenes.at(-0.3, -0.4, 0.8)),
        lights=[
            scenes.light(LightKind.POINT, 2.0, (0.0, 0.0, 2.0), radius=0.3, soft_falloff=False),
            scenes.light(LightKind.SPOT, 2.0, (1.0, 0.0, 2.0), radius=0.1, spot_angle=1.0, spot_blend=0.3),
            scenes.light(LightKind.SUN, 1.0, angle=0.1),
            scenes.light(LightKind.AREA, 2.0, (0.0, -1.0, 2.0), size=(0.6, 0.3), shape=AreaShape.ELLIPSE, spread=2.0),
        ],
        world=sky_picture(), camera=scenes.camera((0.0, -3.0, 1.8), (0.0, 0.0, 0.4)),
    )  # fmt: skip
    holdout = dataclasses.replace(made.instances[2], is_holdout=True)
    return dataclasses.replace(made, instances=(*made.instances[:2], holdout, *made.instances[3:]))


SCENES = {"everything": everything, "glossy room": glossy_room, "cornell": scenes.cornell}
MODES = {
    "rays": {},
    "cones": {"gather_mode": "CONES", "shadow_mode": "CONE"},
    "occlusion": {"gather_mode": "OCCLUSION"},
    "falloff 1, no bounces, no shadows": {"light_falloff": 1.0, "bounces": 0, "use_shadows": False},
    "a pass that gathers nothing": {"gather_interval": 2, "reuse_frames": True},
    "cones in every other pass": {"gather_mode": "CONES", "gather_interval": 2},
    "occlusion in every other pass": {"gather_mode": "OCCLUSION", "gather_interval": 2},
    "limits": {"clamp_indirect": 1.0, "max_distance": 1.5, "specular_aperture": 0.5, "shadow_amount": 0.5},
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scene", SCENES)
def test_every_mode_makes_a_picture(scene: str, mode: str, gpu: GpuContext) -> None:
    """Finite, not black, premultiplied alpha in 0..1; nothing is warned of."""
    with pipeline(
        gpu, SCENES[scene](), scenes.settings(16, **({"bounces": 1} | MODES[mode])), (20, 16), samples=2, outputs=PASSES
    ) as ready:
        assert ready.warnings == []
        for name in PASSES:
            assert np.isfinite(ready.film.read(name)).all(), name
        picture = ready.film.read("combined")
    assert picture[..., :3].min() >= 0.0 and picture[..., :3].max() > 0.05
    assert picture[..., 3].min() >= 0.0 and picture[..., 3].max() <= 1.0


def test_textures_are_seen(gpu: GpuContext) -> None:
    """A checker of 2 x 2 black and white squares from above, lit by a white sky; UV (0, 0) is the lower left corner."""
    picture = node("T", "TexImage", image=checker(2), p_interpolation="Closest")
    made = scenes.scene(
        (scenes.plane(2.0), material(picture, node("D", "BsdfDiffuse", Color="T.Color"), surface="D.BSDF")),
        world=scenes.world(1.0), camera=scenes.camera((0.0, 0.0, 3.0), width=2.0), pixel_filter_width=0.0,
    )  # fmt: skip
    with pipeline(gpu, made, scenes.settings(16), (16, 16), samples=1) as ready:
        found = ready.film.read("combined")[..., 0]
    for rows, columns, expected in ((3, 3, 1.0), (3, 12, 0.0), (12, 3, 0.0), (12, 12, 1.0)):
        assert found[rows, columns] == pytest.approx(expected, abs=0.02)


def test_more_images_than_units(gpu: GpuContext) -> None:
    """A material with nine images, one more than the least GL 4.3 has room for, is rendered."""
    images = [node(f"T{k}", "TexImage", image=checker(2)) for k in range(9)]
    mixes = [images[0]]
    chain = "T0.Color"
    for k in range(1, 9):
        mixes += [images[k], node(f"M{k}", "MixRGB", Fac=0.5, Color1=chain, Color2=f"T{k}.Color")]
        chain = f"M{k}.Color"
    made = scenes.scene(
        (scenes.plane(2.0), material(*mixes, node("D", "BsdfDiffuse", Color=chain), surface="D.BSDF")),
        world=scenes.world(1.0),
    )
    with pipeline(gpu, made, scenes.settings(8), (8, 8), samples=1) as ready:
        assert ready.film.read("combined")[..., :3].max() > 0.5


def test_bindings_are_named() -> None:
    """No digit follows ``binding =``, and every texture, image and buffer has one."""
    root = Path(__file__).resolve().parents[2] / "shaders"
    for path in sorted(root.rglob("*.glsl")):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"binding\s*=\s*\d", text), path
        for line in text.splitlines():
            declares = re.search(r"uniform\s+(?:\w+\s+)*[iu]?(?:sampler|image)[123]D", line) or re.search(
                r"\bbuffer\s+\w+\s*\{", line
            )
            if declares and not line.strip().startswith("//"):
                assert "binding" in line, f"{path}: {line}"


def active_resources(program: int) -> dict[str, int]:
    """Storage blocks, images and samplers that a linked program uses, and the largest binding of each plus one."""
    gl = loader.current_context_loader()
    u, i, p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
    interface_iv = gl.function("glGetProgramInterfaceiv", None, u, u, u, p)
    resource_iv = gl.function("glGetProgramResourceiv", None, u, u, u, i, p, i, p, p)
    uniform_iv = gl.function("glGetUniformiv", None, u, i, p)

    def values(kind: int, index: int, *properties: int) -> list[int]:
        asked, found = (u * len(properties))(*properties), (i * len(properties))()
        resource_iv(program, kind, index, len(properties), asked, len(properties), None, found)
        return list(found)

    def count(kind: int) -> int:
        found = i()
        interface_iv(program, kind, 0x92F5, ctypes.byref(found))  # GL_ACTIVE_RESOURCES
        return found.value

    blocks = [values(0x92E6, k, 0x9302)[0] for k in range(count(0x92E6))]  # GL_SHADER_STORAGE_BLOCK, GL_BUFFER_BINDING
    result = {"buffers": len(blocks), "buffer bindings": max(blocks, default=-1) + 1, "images": 0, "textures": 0,
              "image bindings": 0, "texture bindings": 0}  # fmt: skip
    for k in range(count(0x92E1)):  # GL_UNIFORM
        kind, location, size = values(0x92E1, k, 0x92FA, 0x930E, 0x92FB)  # GL_TYPE, GL_LOCATION, GL_ARRAY_SIZE
        if location < 0:
            continue
        is_image = 0x904C <= kind <= 0x906C
        is_vector = 0x8DC6 <= kind <= 0x8DC8  # GL_UNSIGNED_INT_VEC2 to 4
        is_sampler = 0x8B5D <= kind <= 0x8B64 or 0x8DC0 <= kind <= 0x8DD8 or 0x9108 <= kind <= 0x910D
        is_sampler = is_sampler and not is_vector
        if is_image or is_sampler:
            unit = i()
            uniform_iv(program, location, ctypes.byref(unit))
            name = "image" if is_image else "texture"
            result[name + "s"] += size
            result[name + " bindings"] = max(result[name + " bindings"], unit.value + size)
    return result


def test_sources_that_share_an_image_unit_share_a_texture_unit() -> None:
    """So that no program has both: it would not get along with textures either."""
    units: dict[int, set[int]] = {}
    for name, unit in interface.SOURCES.items():
        units.setdefault(unit, set()).add(interface.slot(name))
    assert all(len(slots) == 1 for slots in units.values()), units
    assert min(units) == len(interface.IMAGES) and max(units) + 3 == interface.SOURCE_UNITS


@pytest.mark.last
def test_programs_keep_to_what_gl_promises(gpu: GpuContext, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most 8 storage buffers, 8 images, 16 textures, and bindings in the same range. Sources are images only where a
    driver has units for them, and else textures."""
    assert len(gpu._kernels) > 5, "run together with the tests that compile shaders"
    kernels = gpu._kernels
    assert not gpu.reads_images or any("#define READS_IMAGES 1" in kernel.source.text for kernel in kernels.values())
    monkeypatch.setattr(gpu, "reads_images", False)
    monkeypatch.setattr(gpu, "_kernels", {})
    most = {"buffers": 0, "images": 0, "textures": 0}
    for (name, defines, texts), kernel in kernels.items():
        if "fetch_source" in kernel.source.text:
            images = active_resources(kernel.shader.glo)["images"]
            assert images <= interface.MOST_IMAGES, (kernel.source.files[1], images)
            kernel = gpu.kernel(name, dict(defines), dict(texts))
        if f"material_texture_{LEAST_TEXTURES};" in kernel.source.text:
            continue  # a material with so many images is compiled only where the driver has more units
        used = active_resources(kernel.shader.glo)
        limits = {"buffer": STORAGE_BUFFERS, "image": IMAGES, "texture": TEXTURES}
        for name, limit in limits.items():
            assert used[name + "s"] <= limit, (kernel.source.files[1], used)
            assert used[name + " bindings"] <= limit, (kernel.source.files[1], used)
            most[name + "s"] = max(most[name + "s"], used[name + "s"])
        x, y, z = (int(n) for n in re.findall(r"\d+", " ".join(sizes(kernel.source.text)))[:3])
        assert x * y * z <= SHARED_THREADS
    assert most["buffers"] >= 4 and most["images"] >= 6 and most["textures"] >= 10, f"the count is broken: {most}"


def sizes(text: str) -> list[str]:
    """Work-group size as three numbers."""
    named = {"GROUP_SIZE": interface.GROUP_SIZE, "TILE_SIZE": interface.TILE_SIZE}
    declared = re.findall(r"local_size_([xyz])\s*=\s*(\w+)", text)
    found = {"x": 1, "y": 1, "z": 1}
    for axis, value in declared:
        found[axis] = max(found[axis], int(named.get(value, value)))
    return [str(found[axis]) for axis in "xyz"]


@pytest.mark.last
def test_shaders_are_glsl_430_for_another_compiler(tmp_path: Path) -> None:
    """glslangValidator, the reference compiler, takes every text that was compiled."""
    validator = shutil.which("glslangValidator")
    if validator is None:
        pytest.skip("there is no glslangValidator (Debian, Fedora: glslang-tools, glslang)")
    assert len(SHADER_VARIANTS) > 5, "run together with the tests that compile shaders"
    files = {}
    for number, ((stage, text), name) in enumerate(SHADER_VARIANTS.items()):
        path = tmp_path / f"{number}.{stage}"
        path.write_text(text, encoding="utf-8")
        files[path] = name
    result = subprocess.run([validator, *map(str, files)], capture_output=True, text=True, check=False)
    found = [line for line in result.stdout.splitlines() if "ERROR" in line or "WARNING" in line]
    assert result.returncode == 0 and not found, "\n".join(
        f"{next((n for p, n in files.items() if str(p) in line), '')} {line}" for line in found[:40]
    )


@pytest.mark.last
def test_another_compiler_notices_mistakes(tmp_path: Path) -> None:
    """The check above can fail: a shader that reads what nobody declared."""
    validator = shutil.which("glslangValidator")
    if validator is None:
        pytest.skip("there is no glslangValidator")
    path = tmp_path / "bad.comp"
    path.write_text(
        resolve("passes/transform.comp.glsl", {}).text.replace("uniform uint triangle_count;", ""), encoding="utf-8"
    )
    assert subprocess.run([validator, str(path)], capture_output=True, check=False).returncode != 0


@pytest.mark.last
def test_conditions_ask_for_what_is_defined() -> None:
    """GLSL 4.30, 3.3: an undefined name in #if is an error, not 0. Few compilers say so."""
    assert len(SHADER_VARIANTS) > 5, "run together with the tests that compile shaders"
    found = set()
    for (_, text), name in SHADER_VARIANTS.items():
        defined = {"__VERSION__", "GL_core_profile", *re.findall(r"^\s*#define\s+(\w+)", text, re.MULTILINE)}
        for condition in re.findall(r"^\s*#(?:el)?if\s+(.*)$", text, re.MULTILINE):
            names = set(re.findall(r"[A-Za-z_]\w*", re.sub(r"//.*|defined\s*\(?\s*\w+\s*\)?", "", condition)))
            found |= {f"{name}: {missing}" for missing in names - defined}
    assert not found, "\n".join(sorted(found))
