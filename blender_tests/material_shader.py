# SPDX-License-Identifier: GPL-3.0-or-later
"""For tests: a whole compute shader around one compiled material, and graphs written in one line."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from addon.materials.compile import MaterialFamily
from addon.materials.graph import ImageSet, MaterialData, Node, NodeGraph, Socket

SHADERS = Path(__file__).resolve().parents[1] / "shaders"


def node(name: str, idname: str, image: ImageSet | None = None, ramp: Any = (), **inputs: Any) -> Node:
    """A node: inputs are numbers, tuples or links 'node.output'; names with _ for blanks; properties by p_name."""
    sockets, properties = {}, {}
    for key, value in inputs.items():
        if key.startswith("p_"):
            properties[key[2:]] = value
            continue
        numbered = key.startswith(("Value_", "Vector_", "Shader_", "A_", "B_", "Factor_"))
        identifier = key if numbered else key.replace("_", " ")
        link = tuple(value.split(".")) if isinstance(value, str) else None
        kind = "VALUE" if isinstance(value, float) else {4: "RGBA"}.get(len(value), "VECTOR")
        sockets[identifier] = Socket(identifier, kind, None if link else value, link)  # type: ignore[arg-type]
    return Node(name, "ShaderNode" + idname, sockets, properties, image, ramp)


def material(*nodes: Node, surface: str, name: str = "Test") -> MaterialData:
    """A material whose surface is the output ``surface`` ('node.output')."""
    output = node("Output", "OutputMaterial", Surface=surface)
    return MaterialData(name, NodeGraph({n.name: n for n in (*nodes, output)}, "Output"))


def with_includes(text: str) -> str:
    """``text`` with every #include replaced by the file."""
    return re.sub(r'#include "([^"]+)"', lambda m: with_includes((SHADERS / m[1]).read_text(encoding="utf-8")), text)


def compute_shader(family: MaterialFamily, count: int = 1) -> str:
    """Evaluates the material at ``count`` points along x: position x, uv (x, 0.25), normal +z, viewer at +z."""
    layers = "".join(
        f"    p.uv[{i}] = vec2(x, 0.25); p.uv_tangent_ws[{i}] = vec3(1.0, 0.0, 0.0);"
        f" p.uv_bitangent_ws[{i}] = vec3(0.0, 1.0, 0.0); p.uv_footprint[{i}] = 0.0;\n"
        for i in range(family.uv_layers)
    ) + "".join(f"    p.color[{i}] = vec4(x, 0.5, 0.25, 0.75);\n" for i in range(family.color_layers))
    samplers = "".join(f"uniform sampler2D material_texture_{i};\n" for i in range(family.textures))
    text = f"""#version 430
#define MATERIAL_UV_LAYERS {family.uv_layers}
#define MATERIAL_COLOR_LAYERS {family.color_layers}
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Parameters {{ vec4 parameters[]; }};
layout(std430, binding = 1) writeonly buffer Results {{ vec4 results[]; }};
layout(std430, binding = 2) readonly buffer Points {{ float points[]; }};
vec4 material_parameter(int i) {{ return parameters[i]; }}
{samplers}
#include "lib/surface.glsl"
{family.source}
void main() {{
    uint i = gl_GlobalInvocationID.x;
    float x = points[i];
    ShadingPoint p;
    p.position_ws = p.position_os = p.generated = vec3(x, 0.25, 0.5);
    p.normal_ws = p.geometric_normal_ws = p.normal_os = vec3(0.0, 0.0, 1.0);
    p.incoming_ws = vec3(0.0, 0.0, 1.0);
    p.back_facing = false;
    p.object_random = 0.5;
    p.object_index = 3.0;
    p.object_position_ws = vec3(1.0, 2.0, 3.0);
{layers}
    Surface s;
    evaluate_material(p, s);
    results[i * 5u] = vec4(s.diffuse, s.roughness);
    results[i * 5u + 1u] = vec4(s.specular_f0, s.transparency.x);
    results[i * 5u + 2u] = vec4(s.specular_f90, 0.0);
    results[i * 5u + 3u] = vec4(s.emission, 0.0);
    results[i * 5u + 4u] = vec4(s.normal_ws, 0.0);
}}
"""
    return with_includes(text)


def world_shader(source: str, textures: int) -> str:
    """A whole compute shader around a compiled world."""
    samplers = "".join(f"uniform sampler2D world_texture_{i};\n" for i in range(textures))
    return with_includes(f"""#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Parameters {{ vec4 parameters[]; }};
layout(std430, binding = 1) buffer Results {{ vec4 results[]; }};
vec4 world_parameter(int i) {{ return parameters[i]; }}
{samplers}
{source}
void main() {{ results[0] = vec4(evaluate_world(results[0].xyz), 0.0); }}
""")


def check_glsl(text: str) -> None:
    """Fails unless ``text`` is a compute shader of GLSL 4.30; does nothing without glslangValidator."""
    validator = shutil.which("glslangValidator")
    if validator is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.comp"
        path.write_text(text, encoding="utf-8")
        result = subprocess.run([validator, str(path)], capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stdout + "\n" + text
