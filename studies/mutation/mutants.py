"""Which mutants a module has: Cosmic Ray's operators, where a number may depend on them.

Cosmic Ray is the optional extra ``mutation``; it is imported where it is used, so that what only
reads results does without.
"""

import ast
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, order=True)
class Mutant:
    """One change: at the `occurrence`-th of all places of a module that an operator changes."""

    line: int
    column: int
    operator: str
    occurrence: int

    def source(self, original: str) -> str:
        """Return the module's source with the change made."""
        from cosmic_ray.mutating import mutate_code

        return mutate_code(original, _operator(self.operator), self.occurrence)

    def is_none(self, original: str, mutated: str) -> bool:
        """Whether Python reads the same: one more than 1e60 is the same float."""
        return ast.dump(ast.parse(mutated)) == ast.dump(ast.parse(original))

    def change(self, original: str, mutated: str) -> str:
        """Say how the line reads before and after."""
        old = original.splitlines()[self.line - 1].strip()
        if self.operator == "RemoveDecorator":
            return f"{old} -> nothing"
        return f"{old} -> {mutated.splitlines()[self.line - 1].strip()}"


def mutants_of(path: Path, operators: list[str]) -> list[Mutant]:
    """Return the mutants of a file in the order of its lines."""
    from cosmic_ray.ast import ast_nodes, get_ast

    nodes = list(ast_nodes(get_ast(path.read_text(encoding="utf-8"))))
    found = []
    for name in operators:
        operator, occurrence = _operator(name), 0
        for node in nodes:
            for (line, column), _ in operator.mutation_positions(node):
                if not is_left_out(node):
                    found.append(Mutant(line, column, name, occurrence))
                occurrence += 1
    return sorted(found)


def is_left_out(node) -> bool:
    """Whether a node of Parso's tree is in a type annotation or in the text of a message.

    Also the mark of arguments by name, which Cosmic Ray takes for a product.
    """
    if node.type == "operator" and node.parent.type == "parameters":
        return True
    while node.parent is not None:
        inner, node = node, node.parent
        if node.type in ("fstring", "tfpdef"):
            return True
        if node.type == "annassign":
            return inner is node.children[1]
        if node.type == "funcdef" and inner is node.annotation:
            return True
    return False


def _operator(name: str):
    from cosmic_ray.plugins import get_operator

    return get_operator(f"core/{name}")()
