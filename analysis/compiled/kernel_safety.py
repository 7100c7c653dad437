"""Keep foreign code out of the kernel cache: no configuration file of the working folder, no folders of other users."""

import os
import stat
import sys
import warnings
from pathlib import Path


def import_numba() -> None:
    """Import numba without reading its configuration file.

    If PyYAML is installed, numba reads ``.numba_config.yaml`` from the working folder at its import and at every
    compilation.  In a folder of recordings from elsewhere, this file could name a cache of foreign binaries.
    """
    absent = object()
    before = sys.modules.get("yaml", absent)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="A Numba config file is found")
        sys.modules["yaml"] = None  # type: ignore[assignment]
        try:
            from numba.core import config
        finally:
            if before is absent:
                del sys.modules["yaml"]
            else:
                sys.modules["yaml"] = before  # type: ignore[assignment]
    config._config_fname = os.devnull + "/never"
    # discards what numba read if another program imported it first
    config._env_reloader.reset()  # type: ignore[no-untyped-call]
    if os.environ.get("NUMBA_CACHE_DIR", "") != config.CACHE_DIR:  # type: ignore[attr-defined]
        raise ImportError("numba's folder of compiled kernels is not the one of the environment")


def only_own(folder: Path) -> bool:
    """Return whether only this user and root can have written to ``folder``, or it does not exist.

    Its files are loaded as code.  A group whose only member is this user counts as this user.
    """
    if not hasattr(os, "getuid"):
        return True
    try:
        found = folder.stat()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    user = os.getuid()
    if found.st_uid not in (user, 0) or found.st_mode & stat.S_IWOTH:
        return False
    return not found.st_mode & stat.S_IWGRP or _own_group(found.st_gid, user)


def _own_group(group: int, user: int) -> bool:
    if sys.platform == "win32":  # Windows has no user groups of this kind
        return True
    import grp
    import pwd

    try:
        named, own = grp.getgrgid(group), pwd.getpwuid(user)
    except KeyError:
        return False
    return own.pw_gid == group and named.gr_name == own.pw_name and set(named.gr_mem) <= {own.pw_name}
