# SPDX-License-Identifier: GPL-3.0-or-later
"""Where this process may write while it has a file open that nobody has vouched for, by Landlock of Linux 5.13 on.

Paths in a scene file tell Blender to write caches, bakes and pictures anywhere. Reading stays as it is.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import os
import struct
import sys
from collections.abc import Iterable

#: Of linux/landlock.h and the generic table of system calls, which x86-64 and arm64 share here.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG, _RULE_PATH_BENEATH = 1, 1
_WRITE_FILE, _REMOVE_DIR, _REMOVE_FILE, _MAKE_DIR, _MAKE_REG, _MAKE_SYM = (1 << bit for bit in (1, 4, 5, 7, 8, 12))
_MAKE_DEVICES = 1 << 6 | 1 << 9 | 1 << 10 | 1 << 11  # and sockets and pipes
_TRUNCATE = 1 << 14  # from version 3 on
_PR_SET_NO_NEW_PRIVS = 38  # of linux/prctl.h

#: Where graphics drivers keep what they compiled, by names of variables and in usual places; and their devices.
_CACHE_VARIABLES = ("XDG_CACHE_HOME", "MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH")
_CACHES = ("~/.cache", "~/.nv")
_DEVICES = ("/dev/null", "/dev/zero", "/dev/shm", "/dev/dri", "/dev/dxg", "/dev/nvidia*")


def confine_writing(folders: Iterable[str]) -> bool:
    """From now on this thread and those it starts write only beneath ``folders`` and where graphics drivers must.

    There is no way back. To be called before ``import bpy``, which starts threads. Returns whether it could be done:
    older systems have nothing of the kind.
    """
    if not sys.platform.startswith("linux"):
        return False
    kernel = ctypes.CDLL(None, use_errno=True)
    call = kernel.syscall
    call.restype = ctypes.c_long
    version = call(_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(_VERSION_FLAG))
    if version < 1:
        return False
    access = _WRITE_FILE | _REMOVE_DIR | _REMOVE_FILE | _MAKE_DIR | _MAKE_REG | _MAKE_SYM | _MAKE_DEVICES
    access |= _TRUNCATE if version >= 3 else 0
    handled = struct.pack("Q", access)
    rules = call(_CREATE_RULESET, handled, ctypes.c_size_t(len(handled)), ctypes.c_uint32(0))
    if rules < 0:
        return False
    try:
        caches = [os.environ.get(name, "") for name in _CACHE_VARIABLES] + list(map(os.path.expanduser, _CACHES))
        for path in {*folders, *caches, *(path for pattern in _DEVICES for path in glob.glob(pattern))} - {""}:
            with contextlib.suppress(OSError):  # one that is not there
                beneath = os.open(path, os.O_PATH | os.O_CLOEXEC)
                allowed = access if os.path.isdir(path) else access & (_WRITE_FILE | _TRUNCATE)
                rule = struct.pack("=Qi", allowed, beneath)
                call(_ADD_RULE, ctypes.c_int(rules), ctypes.c_int(_RULE_PATH_BENEATH), rule, ctypes.c_uint32(0))
                os.close(beneath)
        if kernel.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
            return False
        return bool(call(_RESTRICT_SELF, ctypes.c_int(rules), ctypes.c_uint32(0)) == 0)
    finally:
        os.close(rules)
