"""The spring plate as a thin plate in two dimensions: an independent check of the beam formulas.

Kirchhoff's plate with Morley's triangles (L. S. D. Morley, 1968: w at the corners, its normal slope at the middles of
the edges, constant curvature), clamped at the arm's end, a point load at the disc's centre.
"""

import math

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay

from analysis.shot.recording import Plate

Floats = NDArray[np.float64]


def stiffness_n_per_m(plate: Plate, poisson: float, mesh_m: float) -> float:
    """Return load over deflection at the disc's centre, which is the mesh's last point."""
    points, triangles = _mesh(plate, mesh_m)
    sides = np.sort(np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]], 1), 2)
    edges, inverse = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    inverse = inverse.reshape(-1, 3)
    along = points[edges[:, 1]] - points[edges[:, 0]]
    normal = np.stack([along[:, 1], -along[:, 0]], 1) / np.linalg.norm(along, axis=1)[:, None]
    middle = points[edges].mean(1)
    centre = points[triangles].mean(1)
    values = np.zeros((len(triangles), 6, 6))
    for i in range(3):
        x, y = ((points[triangles[:, i]] - centre) / mesh_m).T
        values[:, i] = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
        x, y = ((middle[inverse[:, i]] - centre) / mesh_m).T
        n, m = normal[inverse[:, i]].T
        values[:, 3 + i] = np.stack([0 * x, n, m, 2 * x * n, y * n + x * m, 2 * y * m], 1) / mesh_m
    shapes = np.linalg.inv(values)
    curvature = np.stack([2 * shapes[:, 3], 2 * shapes[:, 5], 2 * shapes[:, 4]], 1) / mesh_m**2
    rigidity = plate.youngs_modulus_pa * plate.thickness_m**3 / 12 / (1 - poisson**2)
    bending = rigidity * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    a, b = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    blocks = np.einsum("e,eai,ab,ebj->eij", area, curvature, bending, curvature)
    unknowns = np.concatenate([triangles, len(points) + inverse], axis=1)
    size = len(points) + len(edges)
    rows, columns = np.repeat(unknowns, 6, 1).ravel(), np.tile(unknowns, (1, 6)).ravel()
    matrix = sparse.csr_matrix((blocks.ravel(), (rows, columns)), shape=(size, size))
    clamped = points[:, 0] < 1e-9
    free = np.ones(size, dtype=bool)
    free[: len(points)] = ~clamped
    free[len(points) :] = ~(clamped[edges[:, 0]] & clamped[edges[:, 1]])
    load, deflection = np.zeros(size), np.zeros(size)
    load[len(points) - 1] = 1.0
    deflection[free] = spsolve(matrix[free][:, free].tocsc(), load[free])
    return float(1.0 / deflection[len(points) - 1])


def _mesh(plate: Plate, step: float) -> tuple[Floats, NDArray[np.intp]]:
    radius, width = plate.disc_diameter_m / 2, plate.arm_width_m
    centre = plate.arm_length_m + radius
    neck = centre - math.sqrt(radius**2 - (width / 2) ** 2)
    x = np.linspace(0.0, neck, round(neck / step) + 1)
    y = np.linspace(-width / 2, width / 2, round(width / step) + 1)
    arm = np.stack([grid.ravel() for grid in np.meshgrid(x, y)], 1)
    opening = math.asin(width / 2 / radius)
    around = np.linspace(math.pi + opening, 3 * math.pi - opening, round(2 * math.pi * radius / step))[1:-1]
    rim = np.stack([centre + radius * np.cos(around), radius * np.sin(around)], 1)
    count = math.ceil(radius / step)
    grid = np.stack([g.ravel() for g in np.meshgrid(*[np.arange(-count, count + 1) * step] * 2)], 1)
    distance = np.hypot(*grid.T)
    grid = grid[(distance < radius - 0.6 * step) & (distance > 0.3 * step)] + [centre, 0.0]
    grid = grid[~((grid[:, 0] < neck + 0.5 * step) & (np.abs(grid[:, 1]) < width / 2 + 0.3 * step))]
    points = np.concatenate([arm, rim, grid, [[centre, 0.0]]])
    triangles = Delaunay(points + np.random.default_rng(0).normal(0.0, 1e-9, points.shape)).simplices
    at = points[triangles].mean(1)
    in_arm = (at[:, 0] <= neck) & (np.abs(at[:, 1]) < width / 2)
    in_disc = (np.hypot(at[:, 0] - centre, at[:, 1]) < radius) & (at[:, 0] > neck)
    a, b = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    thick = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-6 * step**2
    return points, triangles[(in_arm | in_disc) & thick]
