"""Size of POLAR's photos, px."""

from polarsim.site import polar

SIZE = WIDTH, HEIGHT = polar().images.size
