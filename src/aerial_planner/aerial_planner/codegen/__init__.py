"""CasADi functions evaluated at many points at once, in NumPy's memory, as machine code where there is some."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_planner.codegen.batch import Batch, Interpreted, Pointwise, no_machine_code
    from aerial_planner.codegen.library import (
        CompilationError,
        CompiledFunction,
        Derived,
        FunctionLibrary,
        default_cache,
    )
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "batch": ["Batch", "Interpreted", "Pointwise", "no_machine_code"],
            "library": ["CompilationError", "CompiledFunction", "Derived", "FunctionLibrary", "default_cache"],
        },
    )

__all__ = [
    "Batch",
    "CompilationError",
    "CompiledFunction",
    "Derived",
    "FunctionLibrary",
    "Interpreted",
    "Pointwise",
    "default_cache",
    "no_machine_code",
]
