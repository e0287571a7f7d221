"""When and how one adversary acts: a motion for each kind of adversary, with genes that say what it is like.

Every gene lies in [0, 1]. A script goes by what the ego's frame shows and not by the number of the step. So it acts
much alike in the traffic of another seed.
"""
