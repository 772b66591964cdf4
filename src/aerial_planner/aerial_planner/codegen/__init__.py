"""CasADi functions evaluated for many points at once, in NumPy's memory, as machine code where there is some."""

from aerial_planner.codegen.batch import Batch, Interpreted, Memory, Pointwise, no_machine_code
from aerial_planner.codegen.library import CompilationError, CompiledFunction, Derived, FunctionLibrary, default_cache

__all__ = [
    "Batch",
    "CompilationError",
    "CompiledFunction",
    "Derived",
    "FunctionLibrary",
    "Interpreted",
    "Memory",
    "Pointwise",
    "default_cache",
    "no_machine_code",
]
