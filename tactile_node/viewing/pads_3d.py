"""Show the pads in 3-D, with a column for each taxel. Pairs of pads face each other like the fingers of a gripper."""

from typing import TYPE_CHECKING

import numpy as np

from tactile_node.colour_map import PALETTE, levels
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.states import PadState

if TYPE_CHECKING:
    from viser import BatchedMeshHandle, ClientHandle, LineSegmentsHandle

UNITS_PER_METRE = 100.0       #: scene units per metre, so that a pad is a few units wide, as viser's camera expects
TALLEST_COLUMN = 3.0       #: height of a column at full scale [pitches]
FLAT_COLUMN = 0.15         #: height of a column without load [pitches]
GRIPPER_OPENING = 9.0       #: distance between two pads that face each other [pitches]
NARROW_ASPECT = 0.7        #: aspect ratio below which the width of the pane sets the camera distance
OUTLINE_RGB = (41, 230, 255)
HIDDEN_RGB = (138, 143, 152)
OLD_RGB = (190, 190, 190)
IDENTITY_QUATERNION = np.array((1.0, 0.0, 0.0, 0.0), np.float32)
#: rotation by 180 degrees about x
TURNED_QUATERNION = np.array((0.0, 1.0, 0.0, 0.0), np.float32)
#: corners and faces of a column whose base is at z = 0
BOX_CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (-.45, .45) for x in (-.45, .45)], np.float32)
BOX_FACES = np.array([(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2),
                  (2, 4, 6), (1, 3, 5), (3, 7, 5)], np.uint32)


class Pads3d:
    """3-D sketch of the pads on a gripper, for one browser.

    The order of the pads, not the URDF, determines their positions.
    """

    def __init__(self, client: 'ClientHandle'):
        self._client = client
        self._sizes: dict[str, tuple[tuple[int, ...], float]] = {}
        self._columns: dict[str, BatchedMeshHandle] = {}
        self._outlines: dict[str, LineSegmentsHandle] = {}

    def look_from(self, state: PadState, pads: int) -> None:
        """Place the camera so that ``pads`` pads of the size in ``state`` are in view."""
        width = UNITS_PER_METRE * state.pitch * max(state.values.shape)
        middle = 1.3 * width * ((pads - 1) // 2) / 2
        away = (width + 2 * middle) * max(1.0, NARROW_ASPECT / self._client.camera.aspect)
        self._client.camera.position = (middle + 0.9 * away, -1.7 * away, 0.25 * width + 0.65 * away)
        self._client.camera.look_at = (middle, 0.0, 0.25 * width)

    def show(self, number: int, state: PadState, full_scale: float, is_old: bool) -> None:
        """Show pad ``number``. An old state is drawn flat and pale, because the current load is unknown."""
        # the driver may have restarted with another layout
        if self._sizes.get(state.pad) != (state.values.shape, state.pitch):
            self._add(number, state)
        values, pitch = state.values.ravel(), UNITS_PER_METRE * state.pitch
        heights = np.nan_to_num(np.clip(values / full_scale, 0, 1)) * TALLEST_COLUMN + FLAT_COLUMN
        colours = PALETTE[levels(values, full_scale)]
        colours[np.isnan(values)] = HIDDEN_RGB
        if is_old:
            heights[:], colours[:] = FLAT_COLUMN, OLD_RGB
        scales = np.full((len(values), 3), pitch, np.float32)
        scales[:, 2] *= heights
        scales[state.status.ravel() == TaxelStatus.UNMAPPED] = 0
        columns = self._columns[state.pad]
        columns.batched_colors, columns.batched_scales = colours, scales
        outline = None if is_old or state.contact is None else state.contact.outline
        lines = self._outlines[state.pad]
        lines.visible = outline is not None
        if outline is not None:
            lines.points = self._outline(outline, state)

    def _outline(self, outline: np.ndarray, state: PadState) -> np.ndarray:
        rows, cols = state.values.shape
        corners = np.empty((len(outline), 3), np.float32)
        corners[:, :2] = UNITS_PER_METRE * (outline - state.pitch * np.array((cols - 1, rows - 1)) / 2)
        corners[:, 2] = UNITS_PER_METRE * state.pitch * (TALLEST_COLUMN + FLAT_COLUMN)
        return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)

    def _add(self, number: int, state: PadState) -> None:
        self._sizes[state.pad] = state.values.shape, state.pitch
        rows, cols = state.values.shape
        pitch = UNITS_PER_METRE * state.pitch
        pair, is_upper = divmod(number, 2)
        position = (pair * 1.3 * cols * pitch, 0.0, is_upper * GRIPPER_OPENING * pitch)
        name, scene = f'/pad{number}', self._client.scene
        scene.add_frame(name, show_axes=False, position=position,
                        wxyz=TURNED_QUATERNION if is_upper else IDENTITY_QUATERNION)
        y, x = np.indices((rows, cols)).reshape(2, -1)
        places = np.column_stack((x - (cols - 1) / 2, y - (rows - 1) / 2, np.zeros(x.size))).astype(np.float32) * pitch
        self._columns[state.pad] = scene.add_batched_meshes_simple(
            f'{name}/taxels', BOX_CORNERS, BOX_FACES, np.tile(IDENTITY_QUATERNION, (x.size, 1)), places,
            batched_scales=np.full((x.size, 3), pitch, np.float32), batched_colors=np.zeros((x.size, 3), np.uint8),
            flat_shading=True, cast_shadow=False, receive_shadow=False)
        scene.add_box(f'{name}/base', color=(70, 76, 86), position=(0.0, 0.0, -0.3 * pitch), cast_shadow=False,
                      dimensions=((cols + .6) * pitch, (rows + .6) * pitch, 0.5 * pitch), receive_shadow=False)
        self._outlines[state.pad] = scene.add_line_segments(
            f'{name}/outline', np.zeros((1, 2, 3), np.float32), OUTLINE_RGB, thickness=0.3 * pitch, visible=False)
        scene.add_label(f'{name}/name', state.pad, anchor='bottom-center' if is_upper else 'top-center',
                        # label at the edge that faces the camera
                        position=(0.0, (.5 if is_upper else -.5) * rows * pitch, 0.0))
