"""Draw a picture of the bench, with the taxel values of both pads beside it."""

from pathlib import Path

import mujoco
import numpy as np
from matplotlib.figure import Figure

from bench.planner_world import PITCH, ROWS
from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.world import SIDES, World
from tactile_node.errors import ConfigurationError

SIZE = 720, 960  #: number of rows and columns of the scene [pixels]
LIFT = 0.05      #: height of the lift [m]
DPI = 110


def draw_grasp(world: World, file: Path) -> None:
    """Close the gripper, lift, and draw the bench. Raises ConfigurationError if rendering fails."""
    world.command(Command(0.0))
    world.step(2.0)
    world.move(lift=LIFT)
    world.step(1.5)
    draw(world, file)


def draw(world: World, file: Path) -> None:
    """Draw the current state of the bench. Raises ConfigurationError if rendering fails."""
    scene = render(world)
    figure = Figure(figsize=(13, 4.2), layout='constrained')
    axes = figure.subplot_mosaic([['scene', *SIDES]], width_ratios=(1.33, 1, 1))
    axes['scene'].imshow(scene)
    axes['scene'].set_axis_off()
    axes['scene'].set_title(f'{world.outcome.value}, gap {1e3 * world.gap:.1f} mm')
    felt = {side: world.pressures(side) / 1e3 for side in SIDES}
    most = max(each.max() for each in felt.values()) or 1.0
    low, high = -500 * PITCH, 1e3 * PITCH * (ROWS - 0.5)
    for side, values in felt.items():
        image = axes[side].imshow(values, cmap='inferno', vmin=0, vmax=most, extent=(low, high, high, low))
        axes[side].set_title(f'{side} pad, {world.forces[side]:.2f} N')
        axes[side].set_xlabel('x [mm]')
    # the rows of the right pad run upwards, so invert y to draw both pads the same way up
    axes['right'].invert_yaxis()
    axes['left'].set_ylabel('y [mm]')
    figure.colorbar(image, ax=list(axes.values())[1:], shrink=0.75).set_label('pressure [kPa]')
    figure.savefig(file, dpi=DPI)


def render(world: World) -> np.ndarray:
    """Return the rendered scene as a uint8 array of shape (*SIZE, 3)."""
    try:
        renderer = mujoco.Renderer(world.model, *SIZE)
    # MuJoCo's rendering back ends raise different exceptions
    except (mujoco.FatalError, AttributeError, ImportError, RuntimeError) as error:
        raise ConfigurationError('picture', expected='OpenGL', got=' '.join(str(error).split())[:120],
                                 remedy='On a machine without a screen, set MUJOCO_GL=egl (or osmesa).') from None
    with renderer, world.lock:
        renderer.update_scene(world.data, camera='front')
        scene: np.ndarray = renderer.render().copy()
    return scene
