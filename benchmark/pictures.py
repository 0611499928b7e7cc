"""The benchmark's pictures, as SVG: the same bytes for the same samples."""
import contextlib
import os
import statistics
import tempfile

COLOURS = {"waits (PENDING)": "lightgray", "washes (ACTIVE)": "tab:blue", "asked to stop, washes on": "tab:orange"}


@contextlib.contextmanager
def drawing(path):
    """Yields matplotlib.pyplot, whose figure goes to path at the end."""
    with tempfile.TemporaryDirectory() as os.environ["MPLCONFIGDIR"]:
        import matplotlib
        matplotlib.use("svg")
        # Letters stay letters.
        matplotlib.rcParams.update({"svg.hashsalt": "actions_tutorial", "svg.fonttype": "none"})
        from matplotlib import pyplot
        yield pyplot
        pyplot.savefig(path, format="svg", bbox_inches="tight", metadata={"Date": None, "Creator": None})


def plot(samples, server, path):
    """Draw cancel → result as cumulative distributions."""
    with drawing(path) as pyplot:
        _, axes = pyplot.subplots(figsize=(8, 4.5))
        for kind, name, colour, label in (
                ("floor", "ping", "tab:gray", "bare ROS: a message\nand its answer"),
                ("ours", "cancel", "tab:blue", server + ",\nwoken by the cancel"),
                ("plain", "cancel", "tab:orange", "a server that looks for\na cancel once a second")):
            times = sorted(1e3 * value for value in samples[name, kind])
            # A point for each per cent, which is as much as can be seen
            shares = range(101)
            axes.plot([times[share * (len(times) - 1) // 100] for share in shares], shares, color=colour, linewidth=2,
                      label="%s\nmedian %.3g ms" % (label, statistics.median(times)))
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(pyplot.FuncFormatter(lambda value, _: "%g" % value))
        axes.set(xlabel="time since the cancel was sent (ms, logarithmic)", ylabel="cancels answered by then (%)",
                 ylim=(0, 100), title="How long a cancelled goal takes to end")
        axes.grid(True, which="both", alpha=0.25)
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, labelspacing=1.5)


def timeline(lines, requests, path):
    """Draw how servers take a newer goal and a cancel.

    lines: [(title, [goal of Benchmark.measure_timeline])]; requests: [(s, what is asked for)]; path: the file.
    """
    with drawing(path) as pyplot:
        figure, all_axes = pyplot.subplots(len(lines), figsize=(9, 4.6), sharex=True)
        for axes, (title, goals) in zip(all_axes, lines):
            draw_server(axes, goals)
            axes.set_title(title, loc="left", fontsize=10, weight="bold", pad=30 if axes is all_axes[0] else 4)
            for second, what in requests:
                axes.axvline(second, color="black", linestyle=":", linewidth=1)
                if axes is all_axes[0]:
                    axes.annotate(what, (second, 1), (0, 16), xycoords=("data", "axes fraction"),
                                  textcoords="offset points", ha="center")
        all_axes[-1].set(xlabel="seconds since the first goal was sent", xlim=(-0.1, 7))
        handles = [pyplot.Rectangle((0, 0), 1, 1, color=colour, label=state) for state, colour in COLOURS.items()]
        figure.legend(handles=handles, loc="lower center", ncol=3, frameon=False, bbox_to_anchor=(0.5, -0.07))
        figure.tight_layout()


def took(seconds):
    return "%.0f ms" % (1e3 * seconds) if seconds >= 0.01 else "%.1f ms" % (1e3 * seconds)


def draw_server(axes, goals):
    for y, goal in zip((1, 0), goals):
        spans = zip(COLOURS.values(), (goal["sent"], goal["active"], goal["stop"]),
                    (goal["active"], goal["stop"], goal["ended"]))
        for colour, begin, end in spans:
            axes.barh(y, end - begin, left=begin, height=0.34, color=colour)
        for name, second in goal["bowls"]:
            axes.plot(second, y, "o", color="white", markeredgecolor="black", markersize=6)
            axes.annotate(name, (second, y), (0, 12), textcoords="offset points", fontsize=8)
        axes.annotate("PREEMPTED after " + took(goal["ended"] - goal["stop"]), (goal["ended"], y), (5, 0),
                      textcoords="offset points", va="center", weight="bold", bbox={"color": "white", "pad": 1})
        if y == 0:
            axes.annotate("ACTIVE after " + took(goal["active"] - goal["sent"]), (goal["sent"], y), (-5, 0),
                          textcoords="offset points", ha="right", va="center", weight="bold")
    axes.set(yticks=(1, 0), yticklabels=("first goal", "newer goal"), ylim=(-0.5, 1.6))
    for side in "top", "right":
        axes.spines[side].set_visible(False)
