"""
One contact, from taxel values to a shape with covariance
=========================================================

This example computes the quantities of the paper by Volf, Dvořák and Vlček for a tactile pattern and shows the pattern
in the paper's three planes. The example then recognises the shape with the learned recogniser, and fits pose and size
with their covariance. The example needs NumPy and Matplotlib, but neither ROS nor CAN: ``pip install '.[picture]'``.
"""

# %%
# A frame
# -------
#
# The object is a right triangle of 40 mm by 24 mm, turned by 25 degrees, on a pad of 16 x 16 taxels with a pitch of 4
# mm. Each taxel reads 60 kPa times the covered share of its area, with noise of 300 Pa. One taxel is dead and has the
# value NaN, not 0.

import matplotlib.pyplot as plt
import numpy as np

import tactile_node as tn

PITCH = 0.004  # distance between neighbouring taxels [m]
SIDE = 16      # number of rows and of columns
FINE = 10      # number of sample points per taxel in each direction


def covered(corners, degrees=0.0, middle=(0.030, 0.030)):
    """Return the share of each taxel covered by a convex polygon with counter-clockwise ``corners``, (n, 2) [m]."""
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
# A taxel belongs to the contact if its reading stands out from the noise and is at least half of the contact's own
# level. A dead taxel that the contact encloses also belongs to the contact.

contact = tn.find_contact(frame, unit='Pa')
print(int(contact.mask.sum()), 'taxels are pressed; the whole pad was seen:', contact.pad_seen)

# %%
# The paper's quantities
# ----------------------
#
# N is the number of pressed taxels, and P05 and P09 are numbers of border taxels. The other quantities are the smallest
# eigenvalues of the five-point and the nine-point Laplacian (section 3 of the paper), the information measures (section
# 4) and the centre of gravity of the matrix (section 5). ``rotated`` contains the smallest and the largest value of
# each quantity over 46 rotations of the pattern (section 6).

features = tn.paper_features(contact)
for name in ('N', 'P05', 'P09', 'lambda5', 'lambda9', 'info_norm5', 'V9', 'alpha9'):
    print(f'{name:12}{features.values[name]:9.4f}')
over = features.rotated['alpha9']
print(f'alpha9 over the rotations: {over.min:.2f} at {over.min_angle}, {over.max:.2f} at {over.max_angle} degrees')

# %%
# The three planes
# ----------------
#
# Each plane has two quantities as its axes, and one or two curves that separate classes (section 7, figures 6 to 8). A
# pattern above the solid line is called a rectangle in the first plane, an isosceles triangle in the second and a
# square in the third. A pattern between the solid and the dashed line is called a right triangle. The points are thirty
# random patterns of each shape that a plane can decide on. The cross is the contact of this example. In the first
# plane, rectangles with an aspect ratio of 2:1 lie among the right triangles.

from tactile_node.package_files import config_path
from tactile_node.shape.volf import VolfClassifier, plane_feature

turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
SHAPES = {
    'circle': np.stack((np.cos(turn), np.sin(turn)), axis=1), 'square': np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
    'rectangle': np.array([[0, 0], [2, 0], [2, 1], [0, 1]]), 'right triangle': np.array([[0, 0], [1.7, 0], [0, 1]]),
    'isosceles triangle': np.array([[0, 0], [1, 0], [0.5, 0.87]])}


def pattern_of(shape):
    """Return the features of a random pattern of ``shape`` with an area of 25 to 80 taxels."""
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
# The paper's classifier goes through the planes from left to right and stops at the first plane where the pattern lies
# above a curve. The classifier can be wrong, because patterns of several shapes lie close together near a curve.

print(tn.Recogniser('volf').recognise(contact).shape.value)

# %%
# The learned recogniser
# ----------------------
#
# The nodes use the learned recogniser by default. The learned recogniser is a small network that reads the pattern and
# the pressures.

found = tn.Recogniser().recognise(contact)
for shape, probability in sorted(found.probabilities.items(), key=lambda pair: -pair[1]):
    print(f'{shape.value:20}{probability:.4f}')

# %%
# Pose and size
# -------------
#
# The fit finds the outline from the pattern and the pressures by least squares. The covariance covers all parameters
# together. The example prints the standard deviations. The true values are 40 mm for the long leg, 24 mm for the short
# leg, (30, 30) mm for the centre and 25 degrees for the angle.

fit = tn.fit_shape(contact, found.shape, PITCH)
deviations = np.sqrt(np.diag(fit.covariance))
for name, value, deviation in zip(fit.parameter_names, fit.parameters, deviations):
    factor, unit = (180 / np.pi, 'degrees') if name == 'angle' else (1000, 'mm')
    print(f'{name:10}{factor * value:8.2f} +- {factor * deviation:.2f} {unit}')

# %%
# The covariance also gives the correlations between the parameters. For example, a longer leg moves the centre along
# this leg.

with np.printoptions(precision=2, suppress=True):
    print(fit.parameter_names)
    print(fit.covariance / np.outer(deviations, deviations))

# %%
# The picture
# -----------
#
# The picture shows the dead taxel in grey. The fit does not use this taxel.

figure, axes = plt.subplots(figsize=(5.5, 4.8), layout='constrained')
tn.plot_frame(frame / 1e3, fit, PITCH, axes)
figure.colorbar(axes.images[0], label='pressure [kPa]')
axes.set(xlabel='x [m]', ylabel='y [m]')
