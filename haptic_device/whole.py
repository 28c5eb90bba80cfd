# SPDX-License-Identifier: Apache-2.0
"""`@whole` and `@part`: a kernel of many functions, optimised and made machine code once, as one.

numba does both for every function together with all that it calls, so at each level of a call tree what is below is
optimised and emitted anew, a tree of small functions many times over. A part is only translated to LLVM's language;
the whole that calls it, or calls what calls it, takes it in. What a part may not do: be called from Python, or make an
array.
"""

import importlib

import numba
from llvmlite import binding
from numba.core import types, typing
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering
from numba.extending import lower_builtin

from haptic_device import cache
from haptic_device.twin import Twin

ERROR_MODEL = "numpy"  # division by zero follows IEEE 754, nothing raises


def part(function, arrays=False):
    """A function of kernels: called by `whole` ones and other parts, TypeError if by Python; may it make arrays?"""
    made = numba.njit(pipeline_class=_PartCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True,
                      _nrt=arrays, **_OPTIONS)(function)
    if not numba.config.DISABLE_JIT:
        _ignore_literals(made)
    return made


def only_with(field, instead=None):
    """Decorates a part, or a kernel, of records with this field: to a caller whose records lack it, it is `instead`.

    So for what there is none of, neither that part nor any below it is typed and translated.
    """

    def decorate(made):
        if not numba.config.DISABLE_JIT:
            _leave_out(made, field, instead)
        return made

    return decorate


def whole(function, *signature):
    """A kernel that Python calls; all the parts it calls are compiled with it. With a signature, at once."""
    numba.config.CACHE_DIR = cache.FOLDER
    made = numba.njit(cache=True, **_OPTIONS)(function)
    if not numba.config.DISABLE_JIT:
        _look_aside(made)
        if signature:
            made.compile(*signature)
            made.disable_compile()
    return made


def compile_aside(begin):
    """From now until `compiled_all` a twin of this process compiles what is in no cache; this one loads it from there.

    The twin calls begin() first. What compiling takes, some hundred MB, a process holds until it ends. Call it before
    there are other threads.
    """
    global _twin
    _twin = Twin(_compile, begin)


def compiled_all():
    """Ends the twin, if there is one; what is compiled later this process compiles itself."""
    global _twin
    if _twin is not None:
        _twin.end()
    _twin = None


_twin = None


def _look_aside(made):
    load, function = made._cache.load_overload, made.py_func

    def load_overload(signature, context):
        found = load(signature, context)
        if found is None and _twin is not None:
            _twin.ask((function.__module__, function.__name__, signature))
            found = load(signature, context)  # if that failed, it is compiled here, and says why
        return found

    made._cache.load_overload = load_overload


def _compile(request):
    module, name, signature = request
    known = getattr(importlib.import_module(module), name)
    made = known if hasattr(known, "py_func") else whole(known)
    made.compile(signature)


_OPTIONS = {"nogil": True, "error_model": ERROR_MODEL}


def _ignore_literals(made):
    """numba compiles once for the argument 0, once for 1 and once for any other integer: here for any one only."""
    template = made.get_call_template
    made.get_call_template = lambda given, named: template(
        [types.unliteral(kind) for kind in given], {name: types.unliteral(kind) for name, kind in named.items()})


def _leave_out(made, field, value):
    """To numba a call without the field is a constant, to be written down where the call is."""
    template, overload, kind, key = made.get_call_template, made.get_overload, numba.typeof(value), object()
    lower_builtin(key, types.VarArg(types.Any))(
        lambda context, builder, call, given: context.get_constant_generic(builder, kind, value))

    def has_it(given):
        return any(field in getattr(one, "fields", ()) for one in given)

    def get_call_template(given, named):
        if has_it(given):
            return template(given, named)
        return typing.make_concrete_template("left_out", key, [typing.signature(kind, *given)]), None, given, named

    made.get_call_template = get_call_template
    made.get_overload = lambda given: overload(given) if has_it(given) else key


class _PartLibrary(JITCodeLibrary):
    """LLVM code as it was written down; what it links are the parts it calls, their parts, and so on, callers first."""

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout

    def add_linking_library(self, library):
        if library not in self._linking_libraries:
            super().add_linking_library(library)

    def finalize(self):
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "part_lowering"

    def run_pass(self, state):
        context = state.targetctx
        state.library = _PartLibrary(context.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        refusal = _refusal(lowered, state.library)
        # a caller need not know that these are parts: numba's own njit links no further than it is told
        context.insert_user_function(refusal, lowered.fndesc, [state.library, *state.library._linking_libraries])
        state["cr"] = lowered._replace(cfunc=refusal)
        return True


class _Flags(Flags):
    """As numba's own, which asks property after property whenever it looks whether it has met a call before."""

    __slots__ = ()

    def values(self):
        return _DEFAULTS | self._values


_DEFAULTS = {name: option.default for name, option in Flags.options.items()}
_OF_NO_USE = {  # to what parts are written in: no closures, no `with`, no loops over literals; each pass takes its time
    "WithLifting", "InlineClosureLikes", "InlineInlinables", "MakeFunctionToJitFunction", "FindLiterallyCalls",
    "LiteralUnroll", "LiteralPropagationSubPipelinePass", "InlineOverloads", "DumpParforDiagnostics",
}  # fmt: skip
_OF_ARRAYS = {"NopythonRewrites"}  # of expressions of arrays, and those make some


class _PartCompiler(CompilerBase):
    def __init__(self, typing, target, library, args, return_type, flags, names):
        super().__init__(typing, target, library, args, return_type, _Flags(flags), names)

    def define_pipelines(self):
        skipped = _OF_NO_USE if self.state.flags.nrt else _OF_NO_USE | _OF_ARRAYS
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [(_PartLowering if kind is NativeLowering else kind, text) for kind, text in manager.passes
                          if kind.__name__ not in skipped]  # fmt: skip
        manager._finalized = False
        manager.finalize()
        return [manager]


def _refusal(lowered, library):
    """What Python gets in place of machine code: PyObject_Call(closure, args, named), which says it is not callable."""
    address = binding.address_of_symbol("PyObject_Call")
    name = lowered.fndesc.qualname.split(".")[-1]
    return numba._dynfunc.make_function(lowered.fndesc.lookup_module(), name, "", address, lowered.env, (library,))
