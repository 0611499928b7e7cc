"""The library robust; catkin adds the generated msg and srv."""
from pkgutil import extend_path

# In sys.path, catkin puts this folder before the one with the messages. A child of multiprocessing inherits sys.path.
__path__ = extend_path(__path__, __name__)
