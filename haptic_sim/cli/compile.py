# SPDX-License-Identifier: Apache-2.0
"""`haptic compile`: all kernels into the cache, so that no later start compiles any."""

import typer


def compile() -> None:
    """Compile all kernels for this machine, on all cores; make setup does so. Ctrl-C keeps what is done."""
    from haptic_device import cache, compiling

    compiling.have(*compiling.names())
    if missing := compiling.missing(compiling.names()):
        raise ValueError(f"not compiled: {', '.join(missing)}; what was said above is why")
    typer.echo(f"all kernels are compiled; they are kept in {cache.FOLDER}")
