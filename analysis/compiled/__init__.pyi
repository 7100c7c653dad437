from .four import add_product, add_products, four_of, four_zeros, put_four
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
    "four_zeros",
    "inlined",
    "kernel",
    "part",
    "put_four",
    "side_by_side",
    "solve_triangle",
    "use_kernel_cache",
    "whole_program",
]
