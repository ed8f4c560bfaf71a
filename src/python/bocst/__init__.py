# SPDX-License-Identifier: BSD-3-Clause
"""Sphere-trees that grow on demand: collision queries on triangle meshes.

Mesh, load_mesh          triangle meshes
Model, Options           a mesh as a collision geometry
Scene, collide_poses     check whole states, or many poses of one pair, in one call
spheres, Mesh.health     spheres and faults of a mesh, as in `bocst inspect`
bocst.fcl                FCL's queries under python-fcl's names
"""
from ._bocst import (
    Health,
    Id,
    Mesh,
    Model,
    Options,
    OracleError,
    OracleInfo,
    Scene,
    Statistics,
    __version__,
    available_oracles,
    collide_poses,
    load_mesh,
    spheres,
)
from . import fcl

__all__ = [
    "Health",
    "Id",
    "Mesh",
    "Model",
    "Options",
    "OracleError",
    "OracleInfo",
    "Scene",
    "Statistics",
    "available_oracles",
    "collide_poses",
    "fcl",
    "load_mesh",
    "spheres",
]
