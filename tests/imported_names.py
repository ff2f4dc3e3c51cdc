"""What the names in a module stand for, followed through imports and their aliases, not through assignments."""

import ast


class ImportedNames:
    """Full names of what the expressions of a module refer to (`import numpy as np`, `from os import system as s`)."""

    def __init__(self, tree: ast.Module):
        self._names: dict[str, str] = {}  # local name -> what was imported under it
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    first = alias.name.split(".")[0]
                    self._names[alias.asname or first] = alias.name if alias.asname else first
            elif isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    self._names[alias.asname or alias.name] = f"{node.module}.{alias.name}"

    def full(self, node: ast.expr) -> str:
        """Full name of what an expression of names and dots refers to; "" for any other expression."""
        if isinstance(node, ast.Name):
            return self._names.get(node.id, node.id)
        if isinstance(node, ast.Attribute) and (before := self.full(node.value)):
            return f"{before}.{node.attr}"
        return ""
