# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, instances, materials and visibility, as read from Blender."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from addon.scene import FloatArray, InstanceData, RayVisibility, SceneData

bpy = pytest.importorskip("bpy")

Extract = Callable[[], SceneData]
QUAD = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]


@pytest.fixture(autouse=True)
def _scene(empty_scene: Any) -> None:
    link("camera", bpy.data.cameras.new("camera"))
    empty_scene.camera = bpy.data.objects["camera"]
    empty_scene.render.resolution_x = empty_scene.render.resolution_y = 8


def link(name: str, data: Any, collection: Any = None) -> Any:
    obj = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def mesh(name: str, vertices: Any = QUAD, faces: Any = ((0, 1, 2, 3),)) -> Any:
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    return data


def triangles(scene: SceneData, name: str) -> int:
    """Number of triangles of all instances of an object."""
    return sum(len(scene.meshes[i.mesh].triangle_vertices) for i in scene.instances if i.name == name)


def world_positions(scene: SceneData, instance: InstanceData) -> FloatArray:
    positions = scene.meshes[instance.mesh].positions
    return positions @ instance.world_from_object[:3, :3].T + instance.world_from_object[:3, 3]


def material_names(scene: SceneData, instance: InstanceData) -> list[str]:
    return [scene.materials[i].name for i in instance.materials]


def instances_of(scene: SceneData, name: str) -> list[InstanceData]:
    return [i for i in scene.instances if i.name == name]


def test_counts_of_primitives(extract: Extract) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    bpy.ops.mesh.primitive_cylinder_add(vertices=12)
    scene = extract()
    assert triangles(scene, "Cube") == 12
    assert triangles(scene, "Icosphere") == 20 * 4**2
    assert triangles(scene, "Cylinder") == 2 * 12 + 2 * (12 - 2)
    assert scene.warnings == ()
    for data in scene.meshes:
        assert data.positions.dtype == data.corner_normals.dtype == np.float32
        assert data.triangle_vertices.dtype == data.triangle_corners.dtype == data.triangle_slots.dtype == np.int32
        assert np.allclose(np.linalg.norm(data.corner_normals, axis=1), 1.0, atol=1e-5)


def test_modifiers(extract: Extract) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.modifiers.new("subdivide", "SUBSURF").render_levels = 2
    assert triangles(extract(), "Cube") == 6 * 4**2 * 2  # the render's level, not the viewport's 1


def test_curve_surface_text_and_metaball_give_meshes(extract: Extract) -> None:
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.1, 0
    curve.splines.new("POLY").points.add(1)
    curve.splines[0].points[1].co = (1.0, 0.0, 0.0, 1.0)
    link("curve", curve)
    link("path", bpy.data.curves.new("path", "CURVE"))
    text = bpy.data.curves.new("text", "FONT")
    text.body = "I"
    link("text", text)
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    bpy.context.object.name = "surface"
    ball = bpy.data.metaballs.new("ball")
    ball.elements.new()
    link("ball", ball)
    scene = extract()
    assert triangles(scene, "curve") == 4 * 2  # a tube of four sides
    for name in ("text", "surface", "ball"):
        assert triangles(scene, name) > 0, name
        assert len(instances_of(scene, name)) == 1, name
    assert triangles(scene, "path") == 0
    assert scene.warnings == ()


def test_curve_in_a_collection_instance(extract: Extract) -> None:
    text = bpy.data.curves.new("text", "FONT")
    text.body = "I"
    collection = bpy.data.collections.new("letters")
    link("text", text, collection)
    for x in (1.0, 2.0):
        empty = link("empty", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (x, 0.0, 0.0)
    scene = extract()
    assert len(scene.instances) == 2 and len(scene.meshes) == 1
    assert sorted(i.world_from_object[0, 3] for i in scene.instances) == [1.0, 2.0]


def test_an_instance_equals_a_realised_copy(extract: Extract) -> None:
    part = link("part", mesh("part"), bpy.data.collections.new("parts"))
    part.location, part.rotation_euler, part.scale = (1.0, 2.0, 3.0), (0.3, -0.2, 0.7), (1.0, 2.0, -0.5)
    empty = link("empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["parts"]
    empty.location, empty.rotation_euler, empty.scale = (-4.0, 0.0, 1.0), (0.0, 0.5, 0.0), (2.0, 1.0, 1.0)
    instanced = extract()
    assert len(instanced.instances) == 1

    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    matrix = next(i.matrix_world.copy() for i in depsgraph.object_instances if i.object.name == "part")
    real = mesh("real")
    real.transform(matrix)
    bpy.data.objects.remove(empty)
    link("real", real)
    realised = extract()
    assert np.allclose(
        world_positions(instanced, instanced.instances[0]), world_positions(realised, realised.instances[0]), atol=1e-6
    )
    assert np.linalg.det(instanced.instances[0].world_from_object[:3, :3]) < 0.0  # mirrored, and kept


def test_linked_duplicates_share_one_mesh(extract: Extract) -> None:
    shared = mesh("shared")
    for name in "abc":
        link(name, shared).location.x = ord(name)
    scene = extract()
    assert len(scene.meshes) == 1 and len(scene.instances) == 3


def test_vertex_instances(extract: Extract) -> None:
    parent = link("parent", mesh("points"))
    parent.instance_type = "VERTS"
    parent.show_instancer_for_render = False
    link("child", mesh("child")).parent = parent
    scene = extract()
    assert triangles(scene, "parent") == 0
    corners = {tuple(np.round(i.world_from_object[:3, 3], 6)) for i in instances_of(scene, "child")}
    assert corners >= set(QUAD)
    assert len(scene.meshes) == 1


def geometry_nodes(obj: Any, build: Callable[[Any, Any], Any]) -> None:
    """Add a modifier; ``build(tree, geometry socket)`` returns the socket to output."""
    tree = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, target = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(build(tree, source.outputs[0]), target.inputs[0])
    obj.modifiers.new("nodes", "NODES").node_group = tree


def test_geometry_nodes_instances_and_materials(extract: Extract) -> None:
    red, blue = bpy.data.materials.new("red"), bpy.data.materials.new("blue")
    base = mesh("base")
    base.materials.append(red)

    def cubes_on_points(tree: Any, geometry: Any) -> Any:
        cube = tree.nodes.new("GeometryNodeMeshCube")
        paint = tree.nodes.new("GeometryNodeSetMaterial")
        paint.inputs["Material"].default_value = blue
        on_points, join = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeJoinGeometry")
        tree.links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
        tree.links.new(paint.outputs["Geometry"], on_points.inputs["Instance"])
        tree.links.new(geometry, on_points.inputs["Points"])
        tree.links.new(on_points.outputs[0], join.inputs[0])
        tree.links.new(geometry, join.inputs[0])
        return join.outputs[0]

    geometry_nodes(link("object", base), cubes_on_points)
    scene = extract()
    assert len(scene.meshes) == 2
    assert triangles(scene, "object") == 2 + 4 * 12
    by_size = {len(scene.meshes[i.mesh].triangle_vertices): i for i in scene.instances}
    for size, name in ((2, "red"), (12, "blue")):
        data, names = scene.meshes[by_size[size].mesh], material_names(scene, by_size[size])
        assert {names[slot] for slot in data.triangle_slots} == {name}
    assert len({i.random for i in scene.instances}) == 5


def test_nan_and_infinite_vertices(extract: Extract) -> None:
    vertices = [*QUAD, (2.0, 0.0, 0.0), (2.0, 1.0, 0.0)]
    data = mesh("broken", vertices, [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)])
    data.vertices[4].co.x = float("nan")
    data.vertices[3].co.y = float("inf")
    link("broken", data)
    link("far", mesh("far", [(0.0, 0.0, 0.0), (1e16, 0.0, 0.0), (0.0, 1.0, 0.0)], [(0, 1, 2)]))
    scene = extract()
    assert triangles(scene, "broken") == 2
    assert triangles(scene, "far") == 0
    kept = scene.meshes[instances_of(scene, "broken")[0].mesh]
    assert np.isfinite(kept.positions).all() and kept.positions.max() <= 2.0
    normals = kept.corner_normals[kept.triangle_corners]
    assert np.allclose(np.abs(normals[..., 2]), 1.0, atol=1e-5)
    assert any('"broken"' in w and w.endswith(": 2") for w in scene.warnings)
    assert any('"far"' in w and w.endswith(": 1") for w in scene.warnings)


def test_triangles_without_area_and_empty_meshes(extract: Extract) -> None:
    link("sliver", mesh("sliver", [*QUAD, (2.0, 0.0, 0.0)], [(0, 1, 2), (0, 1, 4)]))
    link("empty mesh", bpy.data.meshes.new("empty"))
    link("wire", mesh("wire", QUAD, []))
    scene = extract()
    assert triangles(scene, "sliver") == 1
    assert len(scene.instances) == 1
    assert scene.warnings == ()


@pytest.mark.parametrize("scale", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (float("inf"), 1.0, 1.0)])
def test_unusable_scale(extract: Extract, scale: tuple[float, float, float]) -> None:
    link("flat", mesh("flat")).scale = scale
    link("small", mesh("small")).scale = (1e-6, 1e-6, 1e-6)
    scene = extract()
    assert [i.name for i in scene.instances] == ["small"]
    assert len(scene.warnings) == 1 and '"flat"' in scene.warnings[0]


def test_flat_scale(extract: Extract) -> None:
    """What has lost its height still has a surface."""
    thing = link("flat", mesh("flat"))
    thing.scale = (1.0, 1.0, 0.0)
    thing.rotation_euler = (0.3, 0.4, 0.5)
    scene = extract()
    assert [i.name for i in scene.instances] == ["flat"]
    assert scene.warnings == ()


def test_material_slots(extract: Extract) -> None:
    names = ["first", "unused", "third"]
    data = mesh("slots", [*QUAD, (2.0, 0.0, 0.0), (2.0, 1.0, 0.0)], [(0, 1, 2, 3), (1, 4, 5, 2)])
    for name in names:
        data.materials.append(bpy.data.materials.new(name))
    data.polygons[1].material_index = 2
    first = link("by data", data)
    second = link("by object", data)
    second.material_slots[2].link = "OBJECT"
    second.material_slots[2].material = bpy.data.materials.new("own")
    third = link("emptied", data)
    third.material_slots[0].link = "OBJECT"
    third.material_slots[0].material = None
    scene = extract()
    assert len(scene.meshes) == 1
    slots = scene.meshes[0].triangle_slots
    assert slots.tolist() == [0, 0, 2, 2]
    used = {i.name: [material_names(scene, i)[s] for s in (0, 2)] for i in scene.instances}
    assert used == {
        first.name: ["first", "third"],
        second.name: ["first", "own"],
        third.name: ["first", "third"],  # Blender falls back on the slot of the data
    }
    assert "unused" not in [m.name for m in scene.materials]


def test_empty_slot_is_grey(extract: Extract) -> None:
    data = mesh("slots")
    data.materials.append(None)
    link("slots", data)
    scene = extract()
    (material,) = scene.materials
    assert material.name == "Default" and material.graph is None and material.color == (0.8, 0.8, 0.8)


def test_slot_beyond_the_last_is_clamped_and_no_slot_is_default(extract: Extract) -> None:
    data = mesh("clamped")
    data.materials.append(bpy.data.materials.new("a"))
    data.materials.append(bpy.data.materials.new("b"))
    data.polygons[0].material_index = 7
    link("clamped", data)
    link("bare", mesh("bare"))
    scene = extract()
    (clamped,), (bare,) = instances_of(scene, "clamped"), instances_of(scene, "bare")
    assert material_names(scene, clamped)[scene.meshes[clamped.mesh].triangle_slots[0]] == "b"
    assert material_names(scene, bare) == ["Default"]


def test_material_override(extract: Extract) -> None:
    data = mesh("overridden")
    data.materials.append(bpy.data.materials.new("own"))
    link("overridden", data)
    link("bare", mesh("bare"))
    bpy.context.view_layer.material_override = bpy.data.materials.new("override")
    scene = extract()
    assert [m.name for m in scene.materials] == ["override"]
    assert all(material_names(scene, i) == ["override"] for i in scene.instances)


def test_uv_layers_and_colours(extract: Extract) -> None:
    data = mesh("attributes", [*QUAD, (2.0, 0.0, 0.0), (2.0, 1.0, 0.0)], [(0, 1, 2, 3), (1, 4, 5, 2)])
    for name, offset in (("first", 0.0), ("second", 10.0)):
        data.uv_layers.new(name=name).uv.foreach_set("vector", np.arange(16, dtype=np.float32) + offset)
    data.uv_layers["second"].active_render = True
    byte = data.color_attributes.new("byte", "BYTE_COLOR", "CORNER")
    byte.data[5].color_srgb = (188 / 255, 0.0, 1.0, 1.0)
    point = data.color_attributes.new("point", "FLOAT_COLOR", "POINT")
    point.data[4].color = (5.0, 6.0, 7.0, 0.5)
    corner = data.attributes.new("on points", "FLOAT2", "POINT")
    corner.data[4].vector = (3.0, 4.0)
    face = data.attributes.new("on faces", "FLOAT_COLOR", "FACE")
    face.data[1].color = (1.0, 2.0, 3.0, 1.0)
    data.color_attributes.render_color_index = data.color_attributes.find("point")
    link("attributes", data)
    (extracted,) = extract().meshes
    assert extracted.active_uv == "second" and extracted.active_color == "point"
    assert extracted.uv_layers["first"][5].tolist() == [10.0, 11.0]
    assert extracted.uv_layers["second"][7].tolist() == [24.0, 25.0]
    # sRGB 188 is linear 0.5029
    assert np.allclose(extracted.color_layers["byte"][5], (0.5029, 0.0, 1.0, 1.0), atol=1e-4)
    assert np.allclose(extracted.color_layers["point"][5], (5.0, 6.0, 7.0, 0.5))
    assert extracted.color_layers["point"].shape == (8, 4)
    assert extracted.uv_layers["on points"][5].tolist() == [3.0, 4.0]
    assert extracted.color_layers["on faces"][:, 1].tolist() == [1.0] * 4 + [2.0] * 4  # new ones are white


def test_smooth_and_flat_normals(extract: Extract) -> None:
    tent = [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0)]
    for name, smooth in (("flat", False), ("smooth", True)):
        data = mesh(name, tent, [(0, 2, 3, 1), (2, 4, 5, 3)])
        data.polygons.foreach_set("use_smooth", [smooth] * 2)
        link(name, data)
    scene = extract()
    by_name = {data.name: data for data in scene.meshes}
    ridge = {name: data.corner_normals[1] for name, data in by_name.items()}
    assert np.allclose(ridge["flat"], (-(0.5**0.5), 0.0, 0.5**0.5), atol=1e-5)
    assert np.allclose(ridge["smooth"], (0.0, 0.0, 1.0), atol=1e-5)


def test_render_visibility(extract: Extract) -> None:
    link("shown", mesh("m")).hide_viewport = True
    link("hidden", mesh("m")).hide_render = True
    no_shadow = link("no shadow", mesh("m"))
    no_shadow.visible_shadow = no_shadow.visible_glossy = False
    nothing = link("nothing", mesh("m"))
    nothing.visible_camera = nothing.visible_diffuse = nothing.visible_glossy = False
    nothing.visible_transmission = nothing.visible_shadow = False
    link("holdout", mesh("m")).is_holdout = True
    scene = extract()
    flags = {i.name: i.visibility for i in scene.instances}
    assert flags == {
        "shown": RayVisibility.ALL,
        "no shadow": RayVisibility.ALL & ~(RayVisibility.SHADOW | RayVisibility.GLOSSY),
        "holdout": RayVisibility.ALL,
    }
    assert [i.name for i in scene.instances if i.is_holdout] == ["holdout"]


def test_collections_of_the_view_layer(extract: Extract) -> None:
    root = bpy.context.scene.collection
    for name in ("indirect", "held out", "excluded"):
        collection = bpy.data.collections.new(name)
        root.children.link(collection)
        link(name, mesh("m"), collection)
    layers = bpy.context.view_layer.layer_collection.children
    layers["indirect"].indirect_only = True
    layers["held out"].holdout = True
    layers["excluded"].exclude = True
    scene = extract()
    by_name = {i.name: i for i in scene.instances}
    assert set(by_name) == {"indirect", "held out"}
    assert by_name["indirect"].visibility == RayVisibility.ALL & ~RayVisibility.CAMERA
    assert by_name["held out"].is_holdout and not by_name["indirect"].is_holdout

    empty = link("empty", None)  # outside these collections, so what it instances is not subject to them
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["held out"]
    assert sorted(i.is_holdout for i in instances_of(extract(), "held out")) == [False, True]


def test_instances_obey_their_instancer_too(extract: Extract) -> None:
    collection = bpy.data.collections.new("parts")
    link("part", mesh("m"), collection).visible_shadow = False
    empty = link("empty", None)
    empty.instance_type, empty.instance_collection, empty.visible_camera = "COLLECTION", collection, False
    (instance,) = extract().instances
    assert instance.visibility == RayVisibility.ALL & ~(RayVisibility.SHADOW | RayVisibility.CAMERA)


def test_unsupported_objects_are_named_once(extract: Extract) -> None:
    link("fur", bpy.data.hair_curves.new("fur"))
    link("cloud", bpy.data.pointclouds.new("cloud"))
    collection = bpy.data.collections.new("smoke")
    link("smoke", bpy.data.volumes.new("smoke"), collection)
    for _ in range(3):
        empty = link("empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
    scene = extract()
    for name in ("fur", "cloud", "smoke"):
        assert sum(f'"{name}"' in w for w in scene.warnings) == 1, (name, scene.warnings)


def test_particle_hair_is_named_and_its_emitter_kept(extract: Extract) -> None:
    obj = link("scalp", mesh("m"))
    obj.modifiers.new("hair", "PARTICLE_SYSTEM")
    obj.particle_systems[0].settings.type = "HAIR"
    scene = extract()
    assert [i.name for i in scene.instances] == ["scalp"]
    assert len(scene.warnings) == 1 and '"scalp"' in scene.warnings[0]


def test_object_random_is_that_of_cycles(extract: Extract) -> None:
    link("q", mesh("m")).pass_index = 5
    (instance,) = extract().instances
    assert instance.random == pytest.approx(0.0699335, abs=1e-6)  # Object Info > Random of "q" in a picture by Cycles
    assert instance.object_index == 5


def test_texture_space(extract: Extract) -> None:
    link("automatic", mesh("automatic"))
    data = mesh("own")
    data.use_auto_texspace = False
    data.texspace_location, data.texspace_size = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    link("own", data)
    bounds = {m.name: m.generated_bounds for m in extract().meshes}
    assert bounds["automatic"] is None
    assert bounds["own"] is not None and bounds["own"].tolist() == [[-3.0, -3.0, -3.0], [5.0, 7.0, 9.0]]
