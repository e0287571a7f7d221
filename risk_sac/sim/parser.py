"""SUMO's XML parser, kept alive between one simulation and the next.

libsumo sets Xerces up for each simulation and takes it down afterwards, and Xerces makes its tables of Unicode's
characters anew each time: a third of the load of a small net. Xerces counts who has set it up, and keeps the tables
while somebody has. So this process is one who has.

Choice: by the name that the compiler gave to Xerces' function, in the library that comes with libsumo. Where that is
built otherwise, nothing changes but the time.

Source: Apache Xerces-C++, `XMLPlatformUtils::Initialize`, which may be called any number of times.
"""

import ctypes
import logging
from functools import cache
from importlib.metadata import PackageNotFoundError, files

logger = logging.getLogger(__name__)

LIBRARY = "libxerces-c"
INITIALIZE = "_ZN11xercesc_3_216XMLPlatformUtils10InitializeEPKcS2_PNS_12PanicHandlerEPNS_13MemoryManagerE"
LOCALE = b"en_US"  # the function's own default, and so what libsumo asks for


@cache
def keep_parser() -> bool:
    """Keeps the parser until the process ends; to be called once libsumo has been started.

    Returns:
      Whether it is kept.
    """
    try:
        library = next(file for file in files("libsumo") or () if file.name.startswith(LIBRARY))
        initialize = ctypes.CDLL(str(library.locate()))[INITIALIZE]
    except (PackageNotFoundError, StopIteration, OSError, AttributeError) as error:
        logger.debug("SUMO's parser is set up anew for each episode: %r", error)
        return False
    initialize.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_void_p, ctypes.c_void_p]
    initialize.restype = None
    initialize(LOCALE, None, None, None)
    return True
