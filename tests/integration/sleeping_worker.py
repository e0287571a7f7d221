"""A stand-in that takes time and no processor: no import but what Python has at its start.

`python -m sleeping_worker FOLDER …` says its two words, which it finds in its environment, and sleeps in between.
"""

import os
import sys
import time

sys.stdin.readline()
words = int(os.environ["RISK_SAC_WORDS"])
os.write(words, b'{"type":"started","pid":%d}\n' % os.getpid())
until = time.monotonic() + float(os.environ["SLEEPING_WORKER_S"])
while (left_s := until - time.monotonic()) > 0:
    os.write(words, b'{"type":"heartbeat"}\n')
    time.sleep(min(left_s, 2.0))
os.write(words, os.environb[b"SLEEPING_WORKER_LAST"] + b"\n")
os._exit(0)
