"""Values of the command line that typer need not look at: what is not given, texts, and what has a parser of its own.

For these, too, typer (0.29) loads pydantic and builds a validator, which takes longer than to convert a small bag.
"""

from collections.abc import Callable
from typing import Any, get_args, get_origin

Process = Callable[[Any, Any], object]
"""Makes a value of what was given in a context of typer, whose classes depend on its version."""


def pass_on(command: Any) -> Callable[..., object]:  # noqa: ANN401 - see `Process`
    """The same command, or group of commands, whose parameters pass such values on themselves."""
    for below in getattr(command, "commands", {}).values():
        pass_on(below)
    every = command.get_params

    def parameters(context: Any) -> list[Any]:  # noqa: ANN401
        found: list[Any] = every(context)
        for parameter in found:
            if "process_value" not in vars(parameter):
                parameter.process_value = _passing(parameter, parameter.process_value)
        return found

    command.get_params = parameters  # with it comes the option for help, which is made late
    run: Callable[..., object] = command
    return run


def _passing(parameter: Any, usual: Process) -> Process:  # noqa: ANN401
    descriptor = getattr(parameter, "type_descriptor", None)
    if descriptor is None:
        return usual
    annotation, parse = descriptor.annotation, getattr(descriptor.parameter_info, "parser", None)
    is_list = parameter.multiple or parameter.nargs == -1
    kind = get_args(annotation)[0] if get_origin(annotation) is list else annotation
    if parse is None and kind is str:
        parse = str

    def process(context: Any, value: Any) -> object:  # noqa: ANN401
        given = list(value) if is_list and isinstance(value, list | tuple) else [value]
        if value is None and not parameter.required:
            made: object = () if is_list else None
        elif parse and given and all(isinstance(one, str) for one in given):
            made = [parse(one) for one in given] if is_list else parse(value)
        else:
            return usual(context, value)
        return parameter.callback(context, parameter, made) if parameter.callback else made

    return process
