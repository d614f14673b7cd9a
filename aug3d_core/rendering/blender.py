"""The bpy scene of one render process: meshes and light are added once, then each camera is rendered.

Blender's camera looks along -z with y up; ours looks along +z with y down. `job.py` defines the shapes.
"""

# bpy and OpenEXR ship no type information:
# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from jaxtyping import Float, Int, UInt8
from mathutils import Matrix

from aug3d_core.geometry.ply import Mesh
from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear
from aug3d_core.rendering.job import Emission, MeshFile, RenderJob, Shard, Sunlit

_COLOUR = "colour"
_SENSOR_MM = 36.0
_TRACED = "cycles.ViewLayer.render_time"  # excludes the time to hand the scene to Cycles
_FAR = 1e9  # Cycles writes 1e10 where a ray hits nothing
_BLENDER_FROM_CAM = np.diag([1.0, -1.0, -1.0, 1.0])


def open_scene(job: RenderJob) -> None:
    """Build the scene that all views of the job share."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    _set_render(scene, job)
    for mesh in job.meshes:
        _add_mesh(scene, mesh, job.light)
    if isinstance(job.light, Sunlit):
        _add_sun_and_sky(scene, job.light)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.sensor_fit, camera.data.sensor_width = "HORIZONTAL", _SENSOR_MM
    camera.data.clip_start, camera.data.clip_end = 1e-4, 1e6
    scene.collection.objects.link(camera)
    scene.camera = camera


def set_camera(
    world_from_cam: Float[np.ndarray, "4 4"], intrinsics: Float[np.ndarray, " 4"], size: Int[np.ndarray, " 2"]
) -> None:
    """Place the camera; the principal point becomes a lens shift, unequal focal lengths the pixel aspect."""
    scene = bpy.context.scene
    fx, fy, cx, cy = map(float, intrinsics)
    width, height = map(int, size)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    aspect = fx / fy  # height of a pixel over its width; Blender wants both numbers at least 1
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1.0, 1 / aspect), max(1.0, aspect)
    lens = scene.camera.data
    lens.lens = fx * _SENSOR_MM / width
    lens.shift_x = (width / 2 - cx) / width
    lens.shift_y = (cy - height / 2) * aspect / width
    scene.camera.matrix_world = Matrix((world_from_cam @ _BLENDER_FROM_CAM).tolist())


@dataclass(frozen=True)
class Picture:
    """One rendered view."""

    rgb: UInt8[np.ndarray, "h w 3"]  # sRGB, not multiplied by alpha
    alpha: UInt8[np.ndarray, "h w"]
    depth: Float[np.ndarray, "h w"] | None  # along the camera's z at each pixel's centre, 0 where nothing was hit
    cycles_s: float  # time that Cycles traced rays


def render_view(shard: Shard, scratch: Path) -> Picture:
    """Render the view, with depth if the job asks for it.

    The pixel filter is a box one pixel wide: a pixel is the mean over its own footprint, as on a sensor. Blender's default
    filter is 1.5 pixels wide and blurs small images. Depth is the first sample only. Cycles takes it at the centre of the
    filter: within 0.001 px of the pixel's centre, for any seed and any number of samples.
    """
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = shard.samples, shard.seed
    scene.render.filepath = str(scratch / "view.exr")
    bpy.ops.render.render(write_still=True)
    # Blender offers float colour and depth in a file only: loading it by bpy.data.images gives one layer.
    with OpenEXR.File(str(scratch / "view.exr"), separate_channels=True) as file:
        channels = {name.rpartition(".")[2]: channel.pixels for name, channel in file.channels().items()}
        seconds = _seconds(file.header()[_TRACED])
    alpha = np.clip(channels["A"], 0.0, 1.0)
    linear = np.stack([channels[c] for c in "RGB"], axis=-1) / np.maximum(alpha, 1e-6)[..., None]
    z = channels.get("Z")
    depth = None if z is None else np.where(z < _FAR, z, 0.0)
    return Picture(srgb_from_linear(linear), np.rint(alpha * 255).astype(np.uint8), depth, seconds)


def _seconds(text: str) -> float:
    """Parse Cycles' hours:minutes:seconds. Cycles cuts it off at 0.01 s, so half of that is added.

    Zero stays zero: there, 0.005 s may be too much.
    """
    hundredths = sum(float(part) * 100 * 60**i for i, part in enumerate(reversed(text.split(":"))))
    return (hundredths + 0.5) / 100 if hundredths else 0.0


def _set_render(scene: bpy.types.Scene, job: RenderJob) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.use_persistent_data = True  # keeps the acceleration structure between views
    render.film_transparent = True
    render.use_compositing = render.use_sequencer = False
    render.threads_mode, render.threads = "FIXED", job.threads
    image = render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.exr_codec, image.color_depth = "OPEN_EXR_MULTILAYER", "NONE", "32"
    image.use_exr_interleave = True  # one part: with several, Blender 5.0 cannot save pixels that are not square
    scene.view_layers[0].use_pass_z = job.depth
    cycles.pixel_filter_type = "BOX"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    sunlit = isinstance(job.light, Sunlit)
    # Under the sky every pixel uses the same few directions. The error of few samples is then a faint overlay of sky
    # shadows, the same in every view of a place, instead of noise. It is also faster, and bpy ships without a denoiser.
    cycles.sampling_pattern, cycles.scrambling_distance = "TABULATED_SOBOL", 0.0 if sunlit else 1.0
    # One bounce carries the sky's light. Where it meets a surface, that surface's light is estimated, not shaded:
    # a third faster, without a visible difference.
    cycles.max_bounces = cycles.diffuse_bounces = 1 if sunlit else 0
    cycles.use_fast_gi, cycles.fast_gi_method, cycles.ao_bounces_render = sunlit, "REPLACE", 1
    cycles.use_light_tree = False  # only useful with many lamps


def _add_mesh(scene: bpy.types.Scene, file: MeshFile, light: Emission | Sunlit) -> None:
    if file.texture is None:
        mesh = Mesh.load(file.path)
        data = _mesh_data(mesh.xyz, mesh.triangles)
        rgba = np.ones((len(mesh.xyz), 4), np.float32)
        rgba[:, :3] = linear_from_srgb(mesh.rgb)
        data.attributes.new(_COLOUR, "FLOAT_COLOR", "POINT").data.foreach_set("color", rgba.ravel())
    else:
        with np.load(file.path) as arrays:
            data = _mesh_data(arrays["vertices"], arrays["triangles"])
            data.uv_layers.new(name="uv").data.foreach_set("uv", arrays["uv"].astype(np.float32).ravel())
    data.materials.append(_material(file, light))
    scene.collection.objects.link(bpy.data.objects.new(file.path.stem, data))


def _mesh_data(vertices: Float[np.ndarray, "v 3"], triangles: Int[np.ndarray, "t 3"]) -> bpy.types.Mesh:
    data = bpy.data.meshes.new("mesh")
    data.vertices.add(len(vertices))
    data.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    data.loops.add(triangles.size)
    data.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    data.polygons.add(len(triangles))
    data.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    data.update()
    data.shade_flat()
    return data


def _material(file: MeshFile, light: Emission | Sunlit) -> bpy.types.Material:
    material = bpy.data.materials.new(file.path.stem)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if file.texture is None:
        colour = tree.nodes.new("ShaderNodeAttribute")
        colour.attribute_name = _COLOUR
    else:
        colour = tree.nodes.new("ShaderNodeTexImage")
        colour.image = bpy.data.images.load(str(file.texture))
    shine = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(colour.outputs["Color"], shine.inputs["Color"])
    surface = shine
    if isinstance(light, Sunlit):
        shine.inputs["Strength"].default_value = light.fill
        matt, surface = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(colour.outputs["Color"], matt.inputs["Color"])
        tree.links.new(shine.outputs[0], surface.inputs[0])
        tree.links.new(matt.outputs[0], surface.inputs[1])
    tree.links.new(surface.outputs[0], output.inputs["Surface"])
    # Otherwise each of 100,000 triangles becomes a lamp.
    material.cycles.emission_sampling = "NONE"
    return material


def _add_sun_and_sky(scene: bpy.types.Scene, light: Sunlit) -> None:
    azimuth, elevation = np.radians([light.sun_azimuth_deg, light.sun_elevation_deg])
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.color, sun.angle = light.sun_strength, light.sun_colour, np.radians(0.53)
    lamp = bpy.data.objects.new("sun", sun)
    # A lamp shines along its -z: tilt it from straight down, then turn it about the vertical.
    lamp.rotation_euler = (np.pi / 2 - elevation, 0.0, np.pi - azimuth)
    scene.collection.objects.link(lamp)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.light_settings.ao_factor = 1.0
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*light.sky_colour, 1.0)
    background.inputs["Strength"].default_value = light.sky_strength
