"""The search for failures: Algorithm 1, its agents, samplers and priors."""
