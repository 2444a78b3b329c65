"""Where Numba keeps what it compiled: under names that change with the source; and what a wheel brings.

A wheel brings loops that were compiled for a processor which many others can stand in for; they are read
where no loop is kept that was compiled here. Also for a user without a home: Numba refuses to work without
a place.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import pickle
import re
import shutil
import zlib
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile, mkdtemp
from typing import Any

FOLDER = Path(__file__).parent
IMPORTED = re.compile(rb"^from seerob\.kernels\.(\w+) import ", re.MULTILINE)
BROUGHT = FOLDER / "compiled"
"""What a wheel brings, packed (`scripts/compile-loops`): as trusted as the sources beside it."""
_TRIED: set[str] = set()
"""Folders into which a file was written already, for trial: once, not for each loop."""
_V2 = "cmov cx8 cx16 fxsr mmx popcnt sahf sse sse2 sse3 sse4.1 sse4.2 ssse3"
_V3 = f"{_V2} avx avx2 bmi bmi2 f16c fma lzcnt movbe"
PROCESSORS = {
    "x86-64-v4": f"{_V3} avx512bw avx512cd avx512dq avx512f avx512vl".split(),
    "x86-64-v3": _V3.split(),
}
"""Processors that loops are brought for, best first, and what one that stands in for them must be able to do;
by LLVM's names, the levels of the psABI of x86-64. All of them fuse a product with a sum (`fma`): results are
those of loops that are compiled here, bit for bit."""


@cache
def stood_in_for() -> tuple[str, ...]:
    """Those of `PROCESSORS` it stands in for, best first; none where Numba is told what it compiles for."""
    from llvmlite import binding
    from numba import config

    settings: Any = config
    if settings.CPU_NAME or settings.CPU_FEATURES is not None or not settings.ENABLE_AVX:
        return ()
    try:
        able = binding.get_host_cpu_features()
    except RuntimeError:  # not known here
        return ()
    return tuple(name for name, needed in PROCESSORS.items() if all(map(able.get, needed)))


@cache
def key_of(module: str, processor: str = "") -> str:
    """Hash of what a module of `seerob.kernels` is compiled from and by, and the processor it is for.

    That is its source and what it imports there, Numba, and the processor (that Numba compiles for).
    """
    import numba
    from llvmlite.binding import get_host_cpu_name

    sources: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in sources:
            sources[name] = (FOLDER / f"{name}.py").read_bytes()
            waiting += [found.decode() for found in IMPORTED.findall(sources[name])]
    processor = processor or numba.config.CPU_NAME or get_host_cpu_name()  # type: ignore[attr-defined]
    content = hashlib.sha256(f"{numba.__version__} {processor}".encode())
    for name in sorted(sources):
        content.update(hashlib.sha256(sources[name]).digest())
    return content.hexdigest()[:16]


def keep_loops() -> None:
    """Have Numba name what it keeps of these loops by `key_of`: what other source gave is never run.

    Numba itself looks at the file of a function alone, not at those of the functions that it calls.
    Where it may write to none of its folders it gets one that lasts as long as this process; nobody else
    may write there: what is read back from it is run.
    """
    from numba import config
    from numba.core import caching, codegen, dispatcher
    from platformdirs import user_cache_path

    known = caching.CompileResultCacheImpl._locator_classes
    if known[0].__module__ != __name__:
        places = caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, caching.UserWideCacheLocator
        known[:0] = [_keyed(place) for place in places]
        dispatcher.FunctionCache = _reading_what_is_brought(caching)  # type: ignore[attr-defined]
        codegen.JITCPUCodegen._library_class = _taken_in_when_asked(codegen)
    if config.CACHE_DIR:  # type: ignore[attr-defined]
        return
    own = FOLDER / "__pycache__", user_cache_path("numba", appauthor=False)
    if any(map(_writable, own)):
        return
    folder = mkdtemp(prefix="seerob-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    # The former is for the processes that this one starts.
    os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = folder  # type: ignore[attr-defined]


def _keyed(place: Any) -> Any:
    """A place where Numba keeps functions, for those of this package alone and under their keys."""

    class Keyed(place):  # type: ignore[misc]
        @classmethod
        def from_function(cls, function: Any, file: str) -> Any:
            path = Path(file)
            return super().from_function(function, file) if path.parent == FOLDER and path.is_file() else None

        def ensure_cache_path(self) -> None:
            path = self.get_cache_path()
            if path not in _TRIED or not os.access(path, os.W_OK):
                super().ensure_cache_path()
                _TRIED.add(path)

        def get_disambiguator(self) -> str:
            return f"{super().get_disambiguator()}-{self.key()}"

        def key(self, processor: str = "") -> str:
            return key_of(Path(self._py_file).stem, processor)

    return Keyed


def _reading_what_is_brought(caching: Any) -> Any:
    """What keeps a function for Numba, and looks into `BROUGHT` for those of this package that it lacks."""
    from numba.core.runtime.nrt import rtsys

    class Packed(caching.IndexDataCacheFile):  # type: ignore[misc]
        def _load_data(self, name: str) -> Any:
            try:
                return pickle.loads(zlib.decompress(Path(self._data_path(name)).read_bytes()))  # noqa: S301
            except zlib.error as error:
                raise OSError("not as scripts/compile-loops packs it") from error  # Numba then has none

    class Reading(caching.FunctionCache):  # type: ignore[misc]
        def load_overload(self, types: Any, context: Any) -> Any:
            place = self._impl.locator
            if not hasattr(place, "key"):
                return super().load_overload(types, context)
            # Numba would first get ready to compile, which takes longer than to load all that a start needs.
            rtsys.initialize(context)
            with self._guard_against_spurious_io_errors():
                found = self._load_overload(types, context)
            if found is not None:
                return found
            types, (triple, *_), code = self._index_key(types, context.codegen())
            for processor in stood_in_for():
                name = self._impl.filename_base.replace(place.key(), place.key(processor))
                brought = Packed(str(BROUGHT), name, place.get_source_stamp())
                if (data := brought.load((types, (triple, processor, ""), code))) is not None:
                    return self._impl.rebuild(context, data)
            return None

    return Reading


def _taken_in_when_asked(codegen: Any) -> Any:
    """Machine code of a loop for Numba; what is kept for loops that call it is read by who compiles one.

    Numba reads it at once, which takes half as long as all the rest of loading a loop.
    """
    from llvmlite import binding

    class Library(codegen.JITCodeLibrary):  # type: ignore[misc]
        _bitcode: bytes | None = None

        @classmethod
        def _unserialize(cls, own: Any, state: tuple[str, str, Any]) -> Any:
            name, kind, data = state
            if kind != "object":
                return super()._unserialize(own, state)
            found = own.create_library(name)
            code, found._bitcode = data
            found.enable_object_caching()
            found._set_compiled_object(code)
            found._finalize_final_module()
            return found

        def get_pointer_to_function(self, name: str) -> Any:
            if self._bitcode is None:  # its symbols are known to Numba
                return super().get_pointer_to_function(name)
            return self._codegen._engine.get_function_address(name)

        def _get_module_for_linking(self) -> Any:
            bitcode, self._bitcode = self._bitcode, None
            if bitcode is not None:
                self._shared_module = binding.parse_bitcode(bitcode)
                self._codegen._engine._load_defined_symbols(self._shared_module)
            return super()._get_module_for_linking()

    return Library


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
