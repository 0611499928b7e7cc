"""The library robust; catkin adds the generated msg and srv."""
from pkgutil import extend_path

# catkin puts this folder before the one with the messages into sys.path, which a child of multiprocessing inherits.
__path__ = extend_path(__path__, __name__)
