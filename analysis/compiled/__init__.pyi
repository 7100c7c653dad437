from .kernel_cache import cache_folder, use_kernel_cache, whole_program
from .kernel_parts import by_address, cut, cut_integers, inlined, kernel, part
from .two_threads import side_by_side, solve_triangle

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
