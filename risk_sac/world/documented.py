"""Base class of models that document their fields."""

import ast
import inspect
import sys
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler
from pydantic_core import CoreSchema


class Documented(BaseModel):
    """Frozen model; strings below its fields describe them in the JSON schema.

    pydantic's `use_attribute_docstrings` parses each class as it is made, which costs each start of a run a third of a
    second. Here the sources are parsed when a JSON schema is wanted, and a model is built when it is first used.
    """

    model_config = ConfigDict(frozen=True, defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Adds the descriptions."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        texts: dict[str, str | None] = {}
        for model in reversed(cls.__mro__[: cls.__mro__.index(Documented)]):
            written = _docstrings(model.__module__).get(model.__name__, {})
            texts |= {name: written.get(name) for name in model.__annotations__}
        for name in properties.keys() & texts.keys():
            if text := texts[name]:
                properties[name].setdefault("description", text)
        return schema


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Returns the strings below a module's class fields, by class and field."""
    classes = ast.walk(ast.parse(inspect.getsource(sys.modules[module])))
    return {node.name: _of_fields(node.body) for node in classes if isinstance(node, ast.ClassDef)}


def _of_fields(body: list[ast.stmt]) -> dict[str, str]:
    texts = {}
    for field, below in pairwise(body):
        match field, below:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                texts[name] = inspect.cleandoc(text)
    return texts
