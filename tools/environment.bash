# shellcheck shell=bash
# An environment with the system's own Python and one ROS 1 in it, whatever the user's holds. To be sourced.

# Foreign Pythons (pyenv, conda, pip --user) and other workspaces on the user's paths must neither help nor harm.
system_environment() {
    unset AMENT_PREFIX_PATH CDPATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH PKG_CONFIG_PATH PYTHONHOME PYTHONPATH \
        ROSLISP_PACKAGE_DIRECTORIES ROS_DISTRO ROS_ETC_DIR ROS_PACKAGE_PATH ROS_ROOT ROS_VERSION VIRTUAL_ENV
    # Nothing from ~/.local, and no __pycache__ in the checkout.
    export PYTHONNOUSERSITE=1 PYTHONDONTWRITEBYTECODE=1 PATH="/usr/bin:/bin:/usr/sbin:/sbin:$PATH"
    # catkin's toplevel.cmake asks for an older CMake than CMake 4 (Debian 14) agrees to be.
    export CMAKE_POLICY_VERSION_MINIMUM=3.5
}

# Sources a setup.bash: those use unset variables and read the arguments of whoever sources them.
source_setup() {
    local setup=$1
    set +u --
    # shellcheck disable=SC1090 # made by catkin
    source "$setup"
}

# Prints the setup.bash of a ROS 1 with Python 3 in /opt/ros, where ROS 2 and older ROS 1 live, too.
opt_ros() {
    local setup
    for setup in /opt/ros/*/setup.bash; do
        if [[ -f $setup ]] && (source_setup "$setup" && [[ $ROS_VERSION$ROS_PYTHON_VERSION == 13 ]]) > /dev/null 2>&1; then
            printf '%s\n' "$setup"
            return
        fi
    done
}
