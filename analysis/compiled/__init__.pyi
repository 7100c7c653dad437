from .four import add_product, add_products, four_of, no_sum, put_four
from .kernel_cache import cache_folder, use_kernel_cache, whole_program
from .kernel_parts import by_address, cut, cut_integers, inlined, kernel, part
from .two_threads import side_by_side, solve_triangle

__all__ = [
    "add_product",
    "add_products",
    "by_address",
    "cache_folder",
    "cut",
    "cut_integers",
    "four_of",
    "inlined",
    "kernel",
    "no_sum",
    "part",
    "put_four",
    "side_by_side",
    "solve_triangle",
    "use_kernel_cache",
    "whole_program",
]
