"""Given poses -> a reconstruction of the working copies: with the points that came with them, or with triangulated ones."""

from __future__ import annotations

import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pycolmap

from aug3d_core.photos.files import image_name
from aug3d_core.poses.files import Given
from aug3d_core.sfm.files import FEATURES
from aug3d_core.sfm.mapping import THREADS


def with_given_points(given: Sequence[Given], source: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Place the photographs and copy each point that at least two of them see."""
    seen_in: dict[int, list[pycolmap.TrackElement]] = defaultdict(list)
    keypoints = {}
    for one in given:
        observed = source.image(one.source_id).get_observation_points2D()
        scale = np.array([one.camera.width / one.original.width, one.camera.height / one.original.height])
        keypoints[one.photo_id] = np.array([point.xy for point in observed], float).reshape(-1, 2) * scale
        for index, point in enumerate(observed):
            seen_in[point.point3D_id].append(pycolmap.TrackElement(_image_id(one.photo_id), index))
    model = _placed(given, {one.photo_id: _image_id(one.photo_id) for one in given}, keypoints)
    for point_id in sorted(seen_in):
        if len({element.image_id for element in seen_in[point_id]}) >= 2:
            point = source.point3D(point_id)
            model.add_point3D(point.xyz, pycolmap.Track(seen_in[point_id]), point.color)
    model.update_point_3d_errors()
    return model


def triangulated(given: Sequence[Given], features: Path, images: Path, seed: int) -> pycolmap.Reconstruction:
    """Place the photographs and triangulate their verified matches; poses and cameras stay as given."""
    with tempfile.TemporaryDirectory() as scratch, pycolmap.Database.open(features) as matched:
        image_ids = {int(Path(image.name).stem): image.image_id for image in matched.read_all_images()}
        model = _placed(given, image_ids, {})
        database = Path(scratch) / FEATURES
        _copy_matches(matched, model, database)
        options = pycolmap.IncrementalPipelineOptions()
        options.num_threads = THREADS
        options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = seed
        return pycolmap.triangulate_points(model, database, images, scratch, options=options)


def matched_keypoints(features: Path, image_ids: set[int]) -> dict[int, int]:
    """Return how many keypoints of each image have a verified match in another of these images."""
    matched = defaultdict(set)
    with pycolmap.Database.open(features) as database:
        for pair, geometry in zip(*database.read_two_view_geometries(), strict=True):
            i, j = pycolmap.pair_id_to_image_pair(pair)
            if {i, j} <= image_ids:
                matched[i].update(geometry.inlier_matches[:, 0].tolist())
                matched[j].update(geometry.inlier_matches[:, 1].tolist())
    return {image_id: len(matched[image_id]) for image_id in image_ids}


def _image_id(photo_id: int) -> int:
    return photo_id + 1


def _placed(
    given: Sequence[Given], image_ids: Mapping[int, int], keypoints: Mapping[int, np.ndarray]
) -> pycolmap.Reconstruction:
    model = pycolmap.Reconstruction()
    camera_ids = {camera: number for number, camera in enumerate(dict.fromkeys(one.camera for one in given), start=1)}
    for camera, camera_id in camera_ids.items():
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(
                camera_id=camera_id,
                model=camera.model,
                width=camera.width,
                height=camera.height,
                params=list(camera.params),
            )
        )
    for one in given:
        image = pycolmap.Image(
            name=image_name(one.photo_id),
            keypoints=keypoints.get(one.photo_id, np.zeros((0, 2))),
            camera_id=camera_ids[one.camera],
            image_id=image_ids[one.photo_id],
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(one.cam_from_world))
    return model


def _copy_matches(matched: pycolmap.Database, model: pycolmap.Reconstruction, target: Path) -> None:
    """Write a database of the model's own cameras: the matcher's has other ones."""
    with pycolmap.Database.open(target) as database:
        for camera in model.cameras.values():
            database.write_camera(camera, use_camera_id=True)
        for rig in model.rigs.values():
            database.write_rig(rig, use_rig_id=True)
        for frame in model.frames.values():
            database.write_frame(frame, use_frame_id=True)
        for image_id, image in model.images.items():
            database.write_image(image, use_image_id=True)
            database.write_keypoints(image_id, matched.read_keypoints(image_id))
        for pair, geometry in zip(*matched.read_two_view_geometries(), strict=True):
            i, j = pycolmap.pair_id_to_image_pair(pair)
            if model.exists_image(i) and model.exists_image(j) and len(geometry.inlier_matches):
                database.write_two_view_geometry(i, j, geometry)
