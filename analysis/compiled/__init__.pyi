from .kernel_bundle import by_address
from .kernel_cache import cache_folder, use_kernel_cache, whole_program
from .kernel_parts import inlined, kernel, part
from .kernel_room import cut, cut_integers
from .triangles import solve_triangle
from .two_threads import side_by_side

__all__ = [
    "by_address",
    "cache_folder",
    "cut",
    "cut_integers",
    "inlined",
    "kernel",
    "part",
    "side_by_side",
    "solve_triangle",
    "use_kernel_cache",
    "whole_program",
]
