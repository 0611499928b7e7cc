#!/usr/bin/python3
"""Measures scripts/action_server.py beside the plain server and beside bare ROS, in one run on one master."""
import argparse
import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time

try:
    from actions_tutorial import robust
    import rospy

    from samples import FULL, QUICK, Benchmark  # and it finds what is in test/
    from harness import Master
except ImportError as error:
    sys.exit("benchmark: %s; run it as ./tutorial benchmark, which sources the workspace" % error)
from report import report


def tell_progress(benchmark, begun):
    """Print what is being measured: a line every 5 s."""
    while True:
        print("%4d s  %s" % (time.monotonic() - begun, benchmark.stage), file=sys.stderr, flush=True)
        time.sleep(5)


def arguments():
    parser = argparse.ArgumentParser(prog="benchmark", description="Measures the action server beside the plain one.")
    parser.add_argument("--json", metavar="FILE", help="write figures and samples")
    parser.add_argument("--plot", metavar="FILE.svg", help="draw cancel → result (needs python3-matplotlib)")
    parser.add_argument("--timeline", metavar="FILE.svg", help="draw a newer goal and a cancel (needs matplotlib, too)")
    parser.add_argument("--server", metavar="PATH", type=os.path.abspath, help="measure this server in place of ours")
    parser.add_argument("--quick", action="store_true", help="20 s, to see that it works: too few samples to quote")
    args = parser.parse_args()
    # Better now than after four minutes:
    if (args.plot or args.timeline) and not importlib.util.find_spec("matplotlib"):
        raise OSError("--plot and --timeline need matplotlib: apt install python3-matplotlib")
    for path in filter(None, (args.json, args.plot, args.timeline)):
        open(path, "a").close()
    if args.server and not os.path.isfile(args.server):
        raise OSError("no server %s" % args.server)
    return args


def measure(args):
    """Returns the exit status: 0 if every figure was measured."""
    begun, plan = time.monotonic(), dict(QUICK if args.quick else FULL, timeline=args.timeline)
    with Master() as master:
        master.start("rosrun", "rosout", "rosout", stdout=subprocess.DEVNULL)  # which takes a part of what is logged
        os.environ.update(master.env)
        robust.init_node("benchmark", disable_signals=True)  # whose end Debian 11's rospy would not survive
        try:
            benchmark = Benchmark(master, args.server, plan)
            threading.Thread(target=tell_progress, args=(benchmark, begun), daemon=True).start()
            benchmark.run()
        finally:
            for number in signal.SIGINT, signal.SIGTERM:  # a second Ctrl-C would leave servers behind
                signal.signal(number, signal.SIG_IGN)
            rospy.signal_shutdown("done")
        report(benchmark, time.monotonic() - begun, args)  # while there is a log for what matplotlib has to say
    return 1 if benchmark.failures else 0


def main():
    for number in signal.SIGINT, signal.SIGTERM:  # also when a script started this in the background
        signal.signal(number, signal.default_int_handler)
    try:
        return measure(arguments())
    except KeyboardInterrupt:
        return "benchmark: stopped"
    except (AssertionError, OSError) as error:
        return "benchmark: %s" % error


if __name__ == "__main__":
    sys.exit(main())
