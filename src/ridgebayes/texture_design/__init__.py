"""Textures under uncertainty: which ridge and groove meet a goal, how surely, and why.

`goals` reads what is asked for, `design.design` answers it.
"""
