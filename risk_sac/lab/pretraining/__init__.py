"""Trains what is shipped as the prior: script episodes before many egos, and what is learnt from them."""
