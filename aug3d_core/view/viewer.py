"""The page: on the left the scene in three dimensions, on the right what the model predicts from where its camera stands.

One person looks at it: in two windows, the camera that moved last is the one whose view is predicted.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import viser

from aug3d_core.run.errors import Aug3dError
from aug3d_core.view import layers
from aug3d_core.view.colours import GROUP, REGISTRATION, SPLIT, colours_of
from aug3d_core.view.film import write_film
from aug3d_core.view.finished import Finished
from aug3d_core.view.latest import Latest
from aug3d_core.view.markdown import literal, told
from aug3d_core.view.pictures import COLOUR, OVERLAYS, Predicted, enlarged, overlaid, photograph
from aug3d_core.view.poses import Pose, fov_of, from_browser, to_browser
from aug3d_core.view.server import stop

if TYPE_CHECKING:
    from aug3d_core.view.predictor import Predictor

_SLOW_S = 0.1  # a view that takes longer is predicted at half its size while the camera moves
_HALF_TIMES = 3  # so much faster that is
_RATED = 5  # the last views, whose times decide
_GREY = np.full((384, 512, 3), 60, np.uint8)


class Viewer:
    """The page of one scene. `predict_with` brings the model, which may be ready later than the page."""

    def __init__(
        self, server: viser.ViserServer, shown: Finished, photo_of: Callable[[int], Path], folder: Path
    ) -> None:
        """photo_of: returns the file of a photograph by its id. folder: for films."""
        self._server, self._shown, self._photo_of, self._folder = server, shown, photo_of, folder
        self._predictor: Predictor | None = None
        self._latest: Latest[Pose] = Latest(self._predict)
        self._pose = layers.look(server, shown)  # predicted before anybody looks, so that a picture is there at once
        self._keys: list[Pose] = []
        self._view: Predicted | None = None
        self._seconds: deque[float] = deque(maxlen=_RATED)
        self._chosen: int | None = None  # row of the photograph that was clicked
        server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large", dark_mode=True)
        server.gui.main_panel.dock_right()
        self._layers = layers.draw(server, shown, self._show_photograph)
        self._panel()
        server.on_client_connect(self._connected)

    def predict_with(self, predictor: Predictor) -> None:
        """Predict from now on, by this model."""
        self._predictor = predictor
        self._latest.ask(self._pose)

    def say(self, why: Exception) -> None:
        """Tell, in place of the figures of predictions, why there are none."""
        self._told.content = f"**No predictions**: {told(why)}"

    def close(self) -> None:
        """Stop predicting and serving."""
        self._latest.end()
        stop(self._server)

    def _panel(self) -> None:
        gui, shown = self._server.gui, self._shown
        self._picture = gui.add_image(_GREY, label="The model predicts", format="jpeg", jpeg_quality=90)
        self._told = gui.add_markdown("the model is being loaded ...")
        self._overlay = gui.add_dropdown("Over it", OVERLAYS, initial_value=COLOUR)
        self._overlay.on_update(lambda _: self._draw())
        with gui.add_folder("Photograph"):
            self._photo = gui.add_image(_GREY, format="jpeg", visible=False)
            self._photo_told = gui.add_markdown("Click a camera to see its photograph.")
            self._go = gui.add_button("Go to its pose", visible=False)
            self._go.on_click(self._go_there)
        with gui.add_folder("Shown"):
            gui.add_button("Level the horizon").on_click(_level)
            by = gui.add_dropdown("Cameras by", (GROUP, SPLIT, REGISTRATION), initial_value=SPLIT)
            by.on_update(lambda _: self._colour(by.value))
            for name, handles in self._layers.parts.items():
                box = gui.add_checkbox(name, layers.SHOWN_AT_FIRST.get(name, False))
                box.on_update(lambda _, box=box, handles=handles: layers.show(handles, box.value))
            gui.add_markdown(_notes(shown))
        with gui.add_folder("Film"):
            self._path = gui.add_markdown("no key views")
            gui.add_button("Add key view").on_click(lambda _: self._add_key())
            gui.add_button("Clear").on_click(lambda _: self._clear())
            self._write = gui.add_button("Write video")
            self._write.on_click(lambda _: self._film())
        self._colour(SPLIT)

    def _connected(self, client: viser.ClientHandle) -> None:
        client.camera.on_update(lambda camera: self._moved(camera))
        self._moved(client.camera)

    def _moved(self, camera: viser.CameraHandle) -> None:
        self._pose = Pose(from_browser(camera.wxyz, camera.position, self._shown.middle_in_world), float(camera.fov))
        if self._predictor is not None:
            self._latest.ask(self._pose)

    def _predict(self, pose: Pose, still: bool) -> None:
        predictor = self._predictor
        assert predictor is not None
        half = not still and bool(self._seconds) and float(np.median(self._seconds)) > _SLOW_S
        try:
            view = predictor.predict(pose, quick=not still, half=half)
        except Aug3dError as error:
            self._view, self._picture.image = None, _GREY
            self._told.content = told(error)
            return
        except Exception as error:  # a GPU without memory, say: this thread must live to predict the next view
            self._view, self._picture.image = None, _GREY
            self._told.content = f"**This view failed**: {told(error)}"
            return
        if not still:
            self._seconds.append(view.seconds * (_HALF_TIMES if half else 1))
        self._view = view
        self._draw()
        height, width = view.colour.shape[:2]
        from_photos = literal(", ".join(self._shown.names.get(one, str(one)) for one in view.photo_ids))
        figures = f"{view.seconds:.2f} s a view, {1 / view.seconds:.1f} views a second, {width} x {height} px"
        self._told.content = f"{figures}\n\nfrom {from_photos}"

    def _draw(self) -> None:
        if self._view is not None:
            self._picture.image = enlarged(overlaid(self._view, self._overlay.value))

    def _show_photograph(self, row: int) -> None:
        shown = self._shown
        photo_id = int(shown.views.photo_id[row])
        self._chosen = row
        try:
            self._photo.image = photograph(self._photo_of(photo_id))
        except (Aug3dError, OSError) as error:
            self._photo_told.content = told(error)
            return
        role, group, error_px = shown.roles[row] or "none", int(shown.group[row]), shown.error_px[row]
        self._photo_told.content = (
            f"**{literal(shown.names.get(photo_id, str(photo_id)))}** (photo {photo_id})\n\nsplit: {role}; group: "
            f"{'none' if group < 0 else group}; reprojection error: {error_px:.2f} px"
        )
        self._photo.visible = self._go.visible = True

    def _go_there(self, event: viser.GuiEvent) -> None:
        if self._chosen is None or event.client is None:
            return
        views, camera = self._shown.views, event.client.camera
        pose = layers.pose_of(views, self._chosen)
        wxyz, position = to_browser(pose, self._shown.middle_in_world)
        with event.client.atomic():
            camera.fov = fov_of(views.intrinsics[self._chosen], float(views.size[self._chosen, 1]))
            camera.up_direction = -pose[:3, 1]
            camera.position = position
            camera.wxyz = wxyz

    def _colour(self, by: str) -> None:
        shown = self._shown
        self._layers.paint(colours_of(by, shown.roles, shown.group, shown.error_px))

    def _add_key(self) -> None:
        self._keys.append(self._pose)
        self._tell_path()

    def _clear(self) -> None:
        self._keys.clear()
        self._tell_path()

    def _tell_path(self) -> None:
        count = len(self._keys)
        self._path.content = f"{count or 'no'} key view{'' if count == 1 else 's'}"
        layers.draw_path(self._server, self._keys, self._shown)

    def _film(self) -> None:
        if self._predictor is None:
            self._path.content = "there is no model to film with"
            return
        self._write.disabled = True
        reported = time.monotonic()

        def report(done: int, total: int) -> None:
            nonlocal reported
            if done == total or time.monotonic() - reported > 0.5:
                reported = time.monotonic()
                self._path.content = f"{done} of {total} frames"

        try:
            file = write_film(self._predictor, tuple(self._keys), self._folder, f"view_{self._shown.name}", report)
            self._path.content = f"written: {literal(str(file))}"
        except Exception as error:  # viser tells it nobody who looks at the page
            self._path.content = f"**No film**: {told(error)}"
        finally:
            self._write.disabled = False


def _level(event: viser.GuiEvent) -> None:
    """Turn the camera upright: at a photograph's pose it is held as that was."""
    if event.client is not None:
        event.client.camera.up_direction = (0.0, 0.0, 1.0)


def _notes(shown: Finished) -> str:
    placed = len(shown.views)
    lines = [f"{placed} of {placed + shown.unplaced} photographs have a pose. Red cameras: test views."]
    lines += map(literal, shown.lacks)
    return "\n\n".join(lines)
