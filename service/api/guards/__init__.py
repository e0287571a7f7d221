"""Guards before all routes: authorisation, rates and slow clients."""
