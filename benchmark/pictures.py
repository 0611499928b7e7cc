"""The benchmark's pictures, as SVG: the same bytes for the same samples."""
import statistics

import matplotlib
from matplotlib import pyplot

from samples import TIMELINE

COLOURS = {"waits (PENDING)": "lightgray", "washes (ACTIVE)": "tab:blue", "asked to stop, washes on": "tab:orange"}
matplotlib.use("svg")
# Letters stay letters; a curve has as many points as can be seen.
matplotlib.rcParams.update({"svg.hashsalt": "actions_tutorial", "svg.fonttype": "none", "path.simplify_threshold": 0.5,
                            "font.sans-serif": "DejaVu Sans",
                            "axes.spines.top": False, "axes.spines.right": False})


def save(path):
    pyplot.savefig(path, format="svg", bbox_inches="tight",
                   metadata=dict.fromkeys(["Creator", "Date", "Format", "Type"]))


def plot(samples, server, path):
    """Draw cancel → result as cumulative distributions."""
    _, axes = pyplot.subplots(figsize=(8, 4.5))
    for kind, name, colour, label in (
            ("floor", "ping", "tab:gray", "bare ROS: a message\nand its answer"),
            ("ours", "cancel", "tab:blue", server + ",\nwoken by the cancel"),
            ("plain", "cancel", "tab:orange", "a server that looks for\na cancel once a second")):
        times = sorted(1e3 * value for value in samples[name, kind])
        axes.plot(times, [100 * i / (len(times) - 1) for i in range(len(times))], color=colour, linewidth=2,
                  label="%s\nmedian %.3g ms" % (label, statistics.median(times)))
    axes.set_xscale("log")
    axes.minorticks_off()
    axes.xaxis.set_major_formatter(pyplot.FuncFormatter(lambda value, _: "%g" % value))
    axes.set(xlabel="time since the cancel was sent (ms, logarithmic)", ylabel="cancels answered by then (%)",
             ylim=(0, 100), title="How long a cancelled goal takes to end")
    axes.grid(True, alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, labelspacing=1.5)
    save(path)


def timeline(servers, path):
    """Draw how servers take a newer goal and a cancel. servers: title -> [goal], as of Benchmark.timeline."""
    figure, all_axes = pyplot.subplots(len(servers), figsize=(9, 4.6), sharex=True)
    for axes, (title, goals) in zip(all_axes, servers.items()):
        draw_server(axes, goals)
        axes.set_title(title, loc="left", fontsize=10, weight="bold", pad=30 if axes is all_axes[0] else 4)
        for second in TIMELINE:
            axes.axvline(second, color="black", linestyle=":", linewidth=1)
    for second, what in zip(TIMELINE, ("a newer goal is sent", "it is cancelled")):
        all_axes[0].annotate(what, (second, 1), (0, 16), xycoords=("data", "axes fraction"),
                             textcoords="offset points", ha="center")
    all_axes[-1].set(xlabel="seconds since the first goal was sent", xlim=(-0.1, 7))
    handles = [pyplot.Rectangle((0, 0), 1, 1, color=colour, label=state) for state, colour in COLOURS.items()]
    figure.legend(handles=handles, loc="lower center", ncol=3, frameon=False, bbox_to_anchor=(0.5, -0.07))
    figure.tight_layout()
    save(path)


def after(event, seconds):
    return "%s after %.*f ms" % (event, seconds < 0.01, 1e3 * seconds)


def draw_server(axes, goals):
    for y, goal in zip((1, 0), goals):
        moments = [goal[event] for event in ("sent", "active", "stop", "result")]
        for colour, begin, end in zip(COLOURS.values(), moments, moments[1:]):
            axes.barh(y, end - begin, left=begin, height=0.34, color=colour)
        for name, second in goal.items():
            if name.startswith("bowl"):
                axes.plot(second, y, "o", color="white", markeredgecolor="black", markersize=6)
                axes.annotate(name, (second, y), (0, 12), textcoords="offset points", fontsize=8)
        axes.annotate(after("PREEMPTED", goal["result"] - goal["stop"]), (goal["result"], y), (5, 0),
                      textcoords="offset points", va="center", weight="bold", bbox={"color": "white", "pad": 1})
        if y == 0:
            axes.annotate(after("ACTIVE", goal["active"] - goal["sent"]), (goal["sent"], y), (-5, 0),
                          textcoords="offset points", ha="right", va="center", weight="bold")
    axes.set(yticks=(1, 0), yticklabels=("first goal", "newer goal"), ylim=(-0.5, 1.6))
