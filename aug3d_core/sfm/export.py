"""Reconstruction -> plain arrays, in the world, and undistorted pinhole images."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Float, Float32, UInt8
from PIL import Image
from scipy.ndimage import map_coordinates

from aug3d_core.geometry.masks import LEAST_USED, save_mask, used_pixels
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.falloff import Falloff, evened

_RIMS = 64  # that are tried on each axis, where a lens folds the picture over
_ROWS = 256  # of a picture that are worked on at a time
_SAME_PX = 1e-6
_NEARBY_PX = 0.01  # between pixels whose order tells whether the picture is turned over


@dataclass(frozen=True)
class Arrays:
    """What a reconstruction holds: views by photo id, points by id, tracks by point, then view."""

    views: Views
    points: Points
    tracks: Tracks

    def moved(self, b_from_a: Similarity) -> Arrays:
        """Return the same reconstruction in another frame."""
        views = replace(self.views, cam_from_world=b_from_a.move_cameras(self.views.cam_from_world))
        return Arrays(views, replace(self.points, xyz=b_from_a.apply(self.points.xyz)), self.tracks)


def photo_id(image: pycolmap.Image) -> int:
    """Return the photo id that an image's file name states."""
    return int(Path(image.name).stem)


def registered(model: pycolmap.Reconstruction) -> list[pycolmap.Image]:
    """Return the placed images by photo id."""
    return sorted((model.image(image_id) for image_id in model.reg_image_ids()), key=photo_id)


def poses(model: pycolmap.Reconstruction) -> Float[np.ndarray, "n 3 4"]:
    """Return `cam_from_world` of the placed images by photo id."""
    return np.stack([image.cam_from_world().matrix() for image in registered(model)])


def to_arrays(model: pycolmap.Reconstruction) -> Arrays:
    """Return views, points and tracks with distortion removed.

    Undistorting crops the rim, and with it a few observations; points that fewer than two views still see are left out.
    """
    images = registered(model)
    pinholes = _pinholes(model)
    views = Views(
        photo_id=np.array([photo_id(image) for image in images]),
        cam_from_world=poses(model),
        intrinsics=np.stack([pinholes[image.camera_id].params for image in images]),
        size=np.array([[pinholes[image.camera_id].width, pinholes[image.camera_id].height] for image in images]),
    )
    point_ids = np.array(sorted(model.point3D_ids()))
    point, view, xy = _observations(model, images, pinholes)
    point = np.searchsorted(point_ids, point)
    inside = ((xy >= 0) & (xy <= views.size[view])).all(axis=1)
    seen_by = np.bincount(point[inside], minlength=len(point_ids))
    keep = inside & (seen_by[point] >= 2)
    kept_points = np.flatnonzero(seen_by >= 2)
    order = np.lexsort((view[keep], point[keep]))
    point_in_model = [model.point3D(point_ids[index]) for index in kept_points]
    points = Points(
        xyz=np.array([p.xyz for p in point_in_model]).reshape(-1, 3),
        rgb=np.array([p.color for p in point_in_model], np.uint8).reshape(-1, 3),
        error_px=np.array([p.error for p in point_in_model]),
    )
    tracks = Tracks(np.searchsorted(kept_points, point[keep][order]), view[keep][order], xy[keep][order])
    return Arrays(views, points, tracks)


def undistorted_camera(camera: pycolmap.Camera) -> pycolmap.Camera:
    """Return the pinhole camera of the largest image without blank pixels, or pixels that the lens folds over.

    Its axis lies as the camera's does in whole pixels: near it, and all over where the lens does not bend, pixels stay as they
    are. COLMAP's image may lie half a pixel beside them, by the lens's last digits, and is a blend of neighbours then.
    """
    pinhole = pycolmap.undistort_camera(_options(), camera)
    rims = np.array(_folded_rim(camera, pinhole))
    axis, in_colmaps = np.array([camera.principal_point_x, camera.principal_point_y]), pinhole.params[2:] - rims
    in_ours = axis + np.floor(in_colmaps - axis + _SAME_PX)
    size = np.array([pinhole.width, pinhole.height]) - 2 * rims - (in_colmaps - in_ours)
    pinhole.width, pinhole.height = np.floor(size + _SAME_PX).astype(int).tolist()
    pinhole.params = np.concatenate([pinhole.params[:2], in_ours])  # type: ignore[assignment]  (pybind takes arrays)
    return pinhole


def share_cut(camera: pycolmap.Camera) -> float:
    """Return the share of a photograph that its undistorted image lacks because the lens folds the picture over; else 0."""
    if not any(_folded_rim(camera, pycolmap.undistort_camera(_options(), camera))):
        return 0.0
    pinhole = undistorted_camera(camera)
    at = (np.arange(_RIMS) + 0.5) / _RIMS
    rays = camera.cam_from_img(np.stack(np.meshgrid(at * camera.width, at * camera.height), axis=-1).reshape(-1, 2))
    xy = rays * pinhole.params[:2] + pinhole.params[2:]
    return 1 - float(((xy >= 0) & (xy <= [pinhole.width, pinhole.height])).all(axis=1).mean())


def _folded_rim(camera: pycolmap.Camera, pinhole: pycolmap.Camera) -> tuple[int, int]:
    """Return how many pixels to cut off at the left and right, and at the top and bottom, of COLMAP's undistorted image.

    The model of a wide lens may turn back before the edge of the frame: what comes beyond would show the inside again,
    mirrored. What is left is the largest centred image without such pixels.
    """
    size = (pinhole.width, pinhole.height)
    rims = [np.arange(_RIMS) * side // (2 * _RIMS) for side in size]
    x, y = (np.concatenate([rim, (side - rim)[::-1]]) for rim, side in zip(rims, size, strict=True))
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(float)

    def shown(moved: list[float]) -> Float[np.ndarray, "n 2"]:
        rays = (xy + moved - pinhole.params[2:]) / pinhole.params[:2]
        return np.asarray(camera.img_from_cam(np.column_stack([rays, np.ones(len(rays))])))

    here, right, below = (shown(moved) for moved in ([0.0, 0.0], [_NEARBY_PX, 0.0], [0.0, _NEARBY_PX]))
    upright = (np.linalg.det(np.stack([right - here, below - here], axis=1)) > 0).reshape(len(y), len(x))
    upright = upright & upright[::-1]
    inner = (upright & upright[:, ::-1])[:_RIMS, :_RIMS][::-1, ::-1]  # the middle first
    whole = np.logical_and.accumulate(np.logical_and.accumulate(inner, axis=0), axis=1)[::-1, ::-1]
    area = np.multiply.outer(size[1] - 2 * rims[1], size[0] - 2 * rims[0])
    row, column = np.unravel_index(np.argmax(whole * area), area.shape)
    return int(rims[0][column]), int(rims[1][row])


def write_undistorted(
    model: pycolmap.Reconstruction,
    photos: Path,
    out: Path,
    known: Mapping[int, Path],
    falloffs: Mapping[int, Falloff | None],
) -> None:
    """Write the undistorted image of every placed photograph; those that are known, by photo id, are copied.

    falloffs: of cameras by id, which are evened out.
    """
    out.mkdir(parents=True, exist_ok=True)
    pinholes, gains = _pinholes(model), {}
    for camera_id, falloff in falloffs.items():
        if falloff and falloff.evened:
            pinhole = pinholes[camera_id]
            gains[camera_id] = falloff.gain((pinhole.width, pinhole.height), pinhole.params)
    bent = _Bent(model, pinholes)
    for image in registered(model):
        if photo_id(image) in known:
            shutil.copyfile(known[photo_id(image)], out / image_name(photo_id(image)))
            continue
        with Image.open(photos / image.name) as photograph:
            pixels = bent.undone(np.asarray(photograph.convert("RGB")), image.camera_id)
        if image.camera_id in gains:
            pixels = evened(pixels, gains[image.camera_id])
        Image.fromarray(pixels).save(out / image_name(photo_id(image)), compress_level=1)


def write_undistorted_masks(model: pycolmap.Reconstruction, masks: Path, out: Path) -> None:
    """Write the undistorted mask of every placed photograph that has one."""
    bent = _Bent(model, _pinholes(model))
    for image in registered(model):
        used = used_pixels(masks / image.name)
        if used is not None:
            shown = bent.undone(np.where(used, np.uint8(255), np.uint8(0)), image.camera_id)
            save_mask(shown >= LEAST_USED, out / image_name(photo_id(image)))


class _Bent:
    """Photographs as lenses bent them. pinholes: the cameras that they get, by id."""

    def __init__(self, model: pycolmap.Reconstruction, pinholes: Mapping[int, pycolmap.Camera]) -> None:
        self._model, self._pinholes = model, pinholes
        self._places = lru_cache(1)(self._places_of)  # photographs of one camera mostly follow each other

    def undone(self, photograph: UInt8[np.ndarray, "H W *c"], camera_id: int) -> UInt8[np.ndarray, "h w *c"]:
        """Return what the pinhole camera shows, which lies within the photograph."""
        channels = np.atleast_3d(photograph).transpose(2, 0, 1)
        places = self._places(camera_id)
        shown = [map_coordinates(one, places, np.uint8, order=1, mode="nearest") for one in channels]  # rounded
        return np.stack(shown, axis=-1).reshape(*places.shape[1:], *photograph.shape[2:])

    def _places_of(self, camera_id: int) -> Float32[np.ndarray, "2 h w"]:
        """Return the row and the column of the photograph, as indices, that each pixel shows."""
        pinhole, camera = self._pinholes[camera_id], self._model.camera(camera_id)
        fx, fy, cx, cy = pinhole.params
        places = np.empty((2, pinhole.height, pinhole.width), np.float32)
        for top in range(0, pinhole.height, _ROWS):
            rows = np.arange(top, min(top + _ROWS, pinhole.height))
            x, y = np.meshgrid((np.arange(pinhole.width) + 0.5 - cx) / fx, (rows + 0.5 - cy) / fy)
            xy = np.asarray(camera.img_from_cam(np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)))
            places[:, rows] = xy.T[::-1].reshape(2, *x.shape) - 0.5
        return places


def _pinholes(model: pycolmap.Reconstruction) -> dict[int, pycolmap.Camera]:
    return {camera_id: undistorted_camera(camera) for camera_id, camera in model.cameras.items()}


def _options() -> pycolmap.UndistortCameraOptions:
    options = pycolmap.UndistortCameraOptions()
    options.blank_pixels = 0.0
    return options


def _observations(
    model: pycolmap.Reconstruction, images: list[pycolmap.Image], pinholes: dict[int, pycolmap.Camera]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return point id, view index and undistorted xy of every observation."""
    point, view, xy = [], [], []
    for index, image in enumerate(images):
        seen = image.get_observation_points2D()
        point.append(np.array([observed.point3D_id for observed in seen], np.int64))
        view.append(np.full(len(seen), index))
        distorted = np.array([observed.xy for observed in seen], float).reshape(-1, 2)
        in_cam = model.camera(image.camera_id).cam_from_img(distorted)
        params = pinholes[image.camera_id].params
        xy.append(in_cam * params[:2] + params[2:])
    return np.concatenate(point), np.concatenate(view), np.concatenate(xy)
