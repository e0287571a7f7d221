"""The process that reads an upload; nothing else in the service imports it. `python -I -m service.networks.checker`."""
