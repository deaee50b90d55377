"""
One contact, from taxel values to a shape with covariance
=========================================================

What the paper of Volf, Dvořák and Vlček computes of a tactile pattern, where the pattern lies in its three planes, what
the learned recogniser says, and a fit of pose and size with its covariance. It needs NumPy and Matplotlib, neither ROS
nor CAN: ``pip install '.[picture]'``.
"""

# %%
# A frame
# -------
#
# A right triangle of 40 mm by 24 mm, turned by 25 degrees, on a pad of 16 x 16 taxels with a pitch of 4 mm. A taxel
# reads 60 kPa times the part of it that is covered, with a noise of 300 Pa. One taxel is dead: NaN, not 0.

import matplotlib.pyplot as plt
import numpy as np

import tactile_node as tn

PITCH, SIDE, FINE = 0.004, 16, 10  # metres between taxels, taxels of a side, sample points along a taxel


def covered(corners, degrees=0.0, middle=(0.030, 0.030)):
    """The covered part of each taxel under a convex polygon, (n, 2) metres about its middle, counter-clockwise."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    corners = (corners - np.mean(corners, axis=0)) @ np.array([[cos, sin], [-sin, cos]]) + middle
    places = ((np.arange(SIDE * FINE) + 0.5) / FINE - 0.5) * PITCH
    x, y = np.meshgrid(places, places)
    inside = np.ones(x.shape, dtype=bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0)):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0
    return inside.reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))


random = np.random.default_rng(7)
triangle = np.array([[0, 0], [0.040, 0], [0, 0.024]])
frame = 60e3 * covered(triangle, degrees=25) + random.normal(0, 300, (SIDE, SIDE))
frame[6, 6] = np.nan

# %%
# The contact
# -----------
#
# What stands out of the noise, up to half of the contact's own level. A dead taxel that the contact encloses belongs to
# it.

contact = tn.find_contact(frame, unit='Pa')
print(int(contact.mask.sum()), 'taxels are pressed; the whole pad was seen:', contact.pad_seen)

# %%
# The paper's quantities
# ----------------------
#
# N taxels, of which P05 and P09 are border taxels; the smallest eigenvalues of the five- and the nine-point Laplacian
# (section 3), the information measures (section 4), the centre of gravity of the matrix (section 5). ``rotated`` has
# the least and the greatest value of each over 46 rotations of the pattern (section 6).

features = tn.paper_features(contact)
for name in ('N', 'P05', 'P09', 'lambda5', 'lambda9', 'info_norm5', 'V9', 'alpha9'):
    print(f'{name:12}{features.values[name]:9.4f}')
over = features.rotated['alpha9']
print(f'alpha9 over the rotations: {over.min:.2f} at {over.min_angle}, {over.max:.2f} at {over.max_angle} degrees')

# %%
# The three planes
# ----------------
#
# Each plane has two quantities as its axes and one or two curves that separate classes (section 7, figures 6 to 8):
# what lies above the line is called a rectangle, an isosceles triangle, a square; between line and dashed line, a right
# triangle. Points: thirty patterns of each shape that the plane decides on, of random size and angle. Cross: this
# contact. In the first plane, rectangles of 2 to 1 lie among the right triangles.

from tactile_node.package_files import config_path
from tactile_node.shape.volf import VolfClassifier, plane_feature

turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
SHAPES = {
    'circle': np.stack((np.cos(turn), np.sin(turn)), axis=1), 'square': np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
    'rectangle': np.array([[0, 0], [2, 0], [2, 1], [0, 1]]), 'right triangle': np.array([[0, 0], [1.7, 0], [0, 1]]),
    'isosceles triangle': np.array([[0, 0], [1, 0], [0.5, 0.87]])}


def pattern_of(shape):
    """The features of one pattern of a shape, of 25 to 80 taxels."""
    x, y = SHAPES[shape].T
    area = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    corners = SHAPES[shape] * PITCH * np.sqrt(random.uniform(25, 80) / area)
    middle = 0.030 + random.uniform(-PITCH / 2, PITCH / 2, 2)
    return tn.paper_features(tn.find_contact(covered(corners, random.uniform(0, 360), middle) > 0.5),
                             tn.Group.CLASSIFIER)


clouds = {shape: [pattern_of(shape) for _ in range(30)] for shape in SHAPES}
planes = VolfClassifier.from_file(config_path('volf_curves.yaml')).planes
curves = (('rectangle', 'right_triangle'), ('isosceles_triangle',), ('square',))
decided = (SHAPES, ('circle', 'square', 'isosceles triangle'), ('circle', 'square'))
colours = dict(zip(SHAPES, ('tab:blue', 'tab:orange', 'tab:green', 'tab:red', 'tab:purple')))
figure, all_axes = plt.subplots(1, 3, figsize=(12, 4), layout='constrained')
for axes, names, shapes in zip(all_axes, curves, decided):
    horizontal, vertical = planes[names[0]].horizontal, planes[names[0]].vertical
    for shape in shapes:
        axes.plot([plane_feature(each, horizontal) for each in clouds[shape]],
                  [plane_feature(each, vertical) for each in clouds[shape]], '.', color=colours[shape], label=shape)
    x = np.linspace(0, axes.get_xlim()[1], 200)
    for name, style in zip(names, ('-', '--')):
        axes.plot(x, planes[name].curve_at(x), style, color='black', linewidth=1)
    axes.plot(plane_feature(features, horizontal), plane_feature(features, vertical), 'kx', markersize=11,
              markeredgewidth=2.5, label='this contact')
    heights = [plane_feature(each, vertical) for shape in shapes for each in clouds[shape]]
    axes.set(xlabel=' '.join(horizontal), ylabel=' '.join(vertical), ylim=(0, 1.3 * np.percentile(heights, 97)))
all_axes[0].legend(fontsize=8)

# %%
# The paper's classifier reads the planes from left to right and stops where a curve is passed. It can be wrong: so near
# to a curve, patterns of several shapes lie together.

print(tn.Recogniser('volf').recognise(contact).shape.value)

# %%
# The learned recogniser
# ----------------------
#
# What the nodes use by default: a small network on the pattern and the pressures.

found = tn.Recogniser().recognise(contact)
for shape, probability in sorted(found.probabilities.items(), key=lambda pair: -pair[1]):
    print(f'{shape.value:20}{probability:.4f}')

# %%
# Pose and size
# -------------
#
# Outline and pressures fitted by least squares; the covariance is of all parameters together, here as standard
# deviations. The true values: long leg 40 mm, short leg 24 mm, centre at 30 mm and 30 mm, 25 degrees.

fit = tn.fit_shape(contact, found.shape, PITCH)
deviations = np.sqrt(np.diag(fit.covariance))
for name, value, deviation in zip(fit.parameter_names, fit.parameters, deviations):
    factor, unit = (180 / np.pi, 'degrees') if name == 'angle' else (1000, 'mm')
    print(f'{name:10}{factor * value:8.2f} +- {factor * deviation:.2f} {unit}')

# %%
# The correlations of the parameters, from the covariance: a longer leg moves the centre along it.

with np.printoptions(precision=2, suppress=True):
    print(fit.parameter_names)
    print(fit.covariance / np.outer(deviations, deviations))

# %%
# The picture
# -----------
#
# The dead taxel is grey: the fit left it out.

figure, axes = plt.subplots(figsize=(5.5, 4.8), layout='constrained')
tn.plot_frame(frame / 1e3, fit, PITCH, axes)
figure.colorbar(axes.images[0], label='pressure [kPa]')
axes.set(xlabel='x [m]', ylabel='y [m]')
