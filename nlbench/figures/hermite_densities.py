"""Figure 2.1 of Culver 1969: what a third-order Hermite series makes of a Gaussian. It needs no run.

The figure is lost, with the third moments behind it; here they are chosen, so that one density is positive wherever it
matters and the other shows what the thesis warns of: negative probability.
"""

from __future__ import annotations

import math

import numpy as np

from nlbench.figures import hermite, style
from nlbench.figures.picture import Picture

SKEWNESS = (0.0, 0.5, 1.5)  # the third moments, the variance being 1
REACH = 4.5  # standard deviations on either side
POINTS = 361
TITLE = "A Gaussian and two third-order Hermite densities"


def hermite_densities() -> Picture:
    """The densities phi(z) (1 + c/6 He_3(z)) of mean 0, variance 1 and skewness c."""
    z = np.linspace(-REACH, REACH, POINTS)
    figure = style.figure(2.9)
    axes = figure.subplots()
    axes.axhline(0, color="#555555", linewidth=0.7)
    looks = (style.REFERENCE, *style.looks(("first", "second"), None).values())
    words = []
    for index, (skewness, look) in enumerate(zip(SKEWNESS, looks, strict=True)):
        density = hermite.density(z, np.array([1.0, 0.0, 0.0, skewness / math.factorial(3)]))
        name = f"skewness {skewness:g}" if skewness else "Gaussian"
        axes.plot(z, density, **style.line(look, index, POINTS), label=name)
        axes.fill_between(z, density, 0, where=density < 0, color=look.colour, alpha=0.25, linewidth=0)
        words.append(_words(name, z, density))
    axes.set_xlabel("x, in standard deviations from the mean")
    axes.set_ylabel("density")
    axes.set_title(TITLE)
    handles, labels = axes.get_legend_handles_labels()
    style.legend(figure, dict(zip(labels, handles, strict=True)))
    description = (
        f"{TITLE}, all of mean 0 and variance 1. {'; '.join(words)}. Negative probability is shaded."
    )
    return Picture("hermite_densities", TITLE, description, figure)


def _words(name: str, z: np.ndarray, density: np.ndarray) -> str:
    """Where a density is highest, and how low it gets."""
    words = f"{name}: highest at {z[density.argmax()]:.3g}"
    return (
        words if density.min() >= 0 else f"{words}, down to {density.min():.2g} at {z[density.argmin()]:.3g}"
    )
