"""The anchors are two methods that an integrator would choose today: a small CNN, and trees on contour features.

The anchors get the same contact patch as our method, with standard place, level and orientation and with torn pieces
joined. The prepared patch gives the anchors an advantage that they would not have on their own. The
anchors also train on the same samples as our method.
"""


import cv2
import numpy as np
import torch
from sklearn.ensemble import ExtraTreesClassifier
from torch import nn
from torch.nn import functional

from training.samples import UNKNOWN, Samples

CLASSES = UNKNOWN  #: Number of classes. The anchors have no class UNKNOWN.
TREES = 300


class SmallCnn(nn.Module):
    """Network with three convolutions, pooling, two dense layers and about 0.5 million weights."""

    def __init__(self):
        super().__init__()
        def convolution(a, b):  # noqa: E306
            return nn.Sequential(nn.Conv2d(a, b, 3, 1, 1), nn.ReLU())
        self.layers = nn.Sequential(
            convolution(2, 16), nn.MaxPool2d(2), convolution(16, 32), convolution(32, 64), nn.MaxPool2d(2),
            nn.Flatten(), nn.Linear(1600, 288), nn.ReLU(), nn.Linear(288, CLASSES))

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return self.layers(images)


class Cnn:
    """The small CNN, trained for ``epochs`` epochs by Adam with a one-cycle learning rate."""

    name = 'CNN'

    def __init__(self, samples: Samples, epochs: float, seed: int = 1):
        torch.manual_seed(seed)
        self.model = SmallCnn()
        self._train(samples, int(epochs * len(samples.labels) / 256), np.random.default_rng(seed))

    def _train(self, samples: Samples, steps: int, rng: np.random.Generator) -> None:
        optimiser = torch.optim.Adam(self.model.parameters(), 2e-3)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, total_steps=steps + 1)
        for _ in range(steps):
            chosen = rng.integers(len(samples.labels), size=256)
            images, labels = torch.as_tensor(samples.inputs(chosen)[0]), torch.as_tensor(samples.labels[chosen])
            loss = functional.cross_entropy(self.model(images), labels)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()

    def probabilities(self, samples: Samples) -> np.ndarray:
        """Return the probabilities of the five classes as a (K, 5) array."""
        found = []
        with torch.no_grad():
            for part in np.array_split(np.arange(len(samples.labels)), max(len(samples.labels) // 512, 1)):
                found.append(functional.softmax(self.model(torch.as_tensor(samples.inputs(part)[0])), 1).numpy())
        return np.concatenate(found)


class ContourTrees:
    """300 extremely randomised trees on contour features from OpenCV."""

    name = 'contours + trees'

    def __init__(self, samples: Samples, graded: bool, seed: int = 1):
        self.graded = graded
        self.trees = ExtraTreesClassifier(TREES, min_samples_leaf=2, n_jobs=1, random_state=seed)
        self.trees.fit(self.features(samples), samples.labels)

    def features(self, samples: Samples) -> np.ndarray:
        scale = np.exp(samples.geometry[:, 2])
        return np.array([contour_features(level, s, self.graded) for level, s in zip(samples.levels, scale)])

    def probabilities(self, samples: Samples) -> np.ndarray:
        return self.trees.predict_proba(self.features(samples))


def contour_features(level: np.ndarray, scale: float, graded: bool) -> np.ndarray:
    """Return features of the outer contour of a patch. For pressures, the contour comes from a four times finer grid.

    The features are the area, the perimeter, the convex hull, the smallest enclosing rectangle, circle and triangle,
    the fitted ellipse, the corners of polygonal approximations, and Hu's moments of the contour and of the levels.
    """
    image = cv2.resize(level, None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR) if graded else level
    contours, _ = cv2.findContours((image > 80).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.zeros(33, np.float32)
    points = np.concatenate(contours) if len(contours) > 1 else contours[0]
    hull = cv2.convexHull(points)
    taxels = cv2.countNonZero(cv2.inRange(image, 81, 255)) * scale ** 2 / (16 if graded else 1)
    area, length = cv2.contourArea(hull), cv2.arcLength(hull, True)
    (_, sides, _), (_, radius) = cv2.minAreaRect(hull), cv2.minEnclosingCircle(hull)
    around, _ = cv2.minEnclosingTriangle(hull) if len(hull) > 2 else (0.0, None)
    axes = cv2.fitEllipse(hull)[1] if len(hull) >= 5 else sides
    corners = [len(cv2.approxPolyDP(hull, part * length, True)) for part in (0.02, 0.04, 0.06, 0.08, 0.1)]
    unit = np.sqrt(area) + 0.5
    moments, light = cv2.moments(hull), cv2.moments(level)
    hu = [np.sign(h) * np.log10(abs(h) + 1e-12) for m in (moments, light) for h in cv2.HuMoments(m)[:, 0]]
    own = cv2.contourArea(contours[0])
    return np.array([taxels, area * scale ** 2, length / unit, area / (sides[0] * sides[1] + 1), len(contours),
                     area / (np.pi * radius ** 2 + 1), area / (around + 1), min(sides) / (max(sides) + 1e-6),
                     max(sides) / unit, min(sides) / unit, radius / unit, min(axes) / (max(axes) + 1e-6),
                     own / (area + 1), len(hull), *corners, *hu], np.float32)
