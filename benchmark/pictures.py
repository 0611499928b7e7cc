"""The pictures, as SVG."""
import matplotlib
from matplotlib import pyplot
from support.states import ACTIVE

matplotlib.use("svg")
matplotlib.rcParams.update({"svg.fonttype": "none", "axes.spines.top": False, "axes.spines.right": False})
STATES = {"waits (PENDING)": "lightgray", "washes (ACTIVE)": "tab:blue", "should stop, washes on": "tab:orange"}


def draw_cancels(samples, path):
    """Draw how many cancels have a result after how long: a curve for each server."""
    _, axes = pyplot.subplots(figsize=(8, 4))
    for kind, colour, label in (
            ("floor", "tab:gray", "floor: a message and its answer"), ("robust", "tab:blue", "robust_action_server.py"),
            ("hz20", "tab:green", "action_server.py at 20 Hz"), ("plain", "tab:orange", "action_server.py")):
        times = sorted(samples["cancel", kind])
        axes.plot(times, [100 * i / (len(times) - 1) for i in range(len(times))], color=colour, label=label)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(pyplot.FormatStrFormatter("%g"))
    axes.set(xlabel="time since the cancel was sent (ms, logarithmic)", ylabel="cancels with a result by then (%)",
             ylim=(0, 100), title="Cancel → result")
    axes.grid(alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    pyplot.savefig(path, bbox_inches="tight")


def draw_timelines(timelines, path):
    """Draw a goal, a newer one and its cancel, on two servers. timelines: as Benchmark.timelines returns."""
    figure, (plain, robust) = pyplot.subplots(2, figsize=(9, 5), sharex=True)
    for axes, kind, title in (plain, "plain", "action_server.py"), (robust, "robust", "robust_action_server.py"):
        axes.set_title(title, loc="left", fontsize=10, weight="bold", pad=20)
        axes.set(yticks=(1, 0), yticklabels=("first goal", "newer goal"), ylim=(-0.5, 1.5))
        begun = timelines[kind][0]["sent"]
        first, newer = [{event: moment - begun for event, moment in goal.items()} for goal in timelines[kind]]
        draw_goal(axes, 1, first, newer["sent"])
        draw_goal(axes, 0, newer, newer["cancel"])
        axes.text(newer["sent"], 0, "ACTIVE after %.1f ms  " % (1e3 * (newer[ACTIVE] - newer["sent"])),
                  ha="right", va="center")
        for moment, what in (newer["sent"], "a newer goal is sent"), (newer["cancel"], "it is cancelled"):
            axes.axvline(moment, color="black", linestyle=":", linewidth=1)
            axes.text(moment, 1.55, what, ha="center")
    robust.set(xlabel="seconds since the first goal was sent", xlim=(-0.1, 5.5))
    figure.legend(handles=[pyplot.Rectangle((0, 0), 1, 1, color=colour, label=state)
                           for state, colour in STATES.items()],
                  loc="lower center", ncol=3, frameon=False, bbox_to_anchor=(0.5, -0.05))
    figure.tight_layout()
    pyplot.savefig(path, bbox_inches="tight")


def draw_goal(axes, y, goal, stop):
    """Draw the states and bowls of a goal. goal: {event: s since the start}; stop: when it should stop (s)."""
    moments = goal["sent"], goal[ACTIVE], stop, goal["result"]
    for colour, begin, end in zip(STATES.values(), moments, moments[1:]):
        axes.barh(y, end - begin, left=begin, height=0.34, color=colour)
    for event, moment in goal.items():
        if str(event).startswith("bowl"):
            axes.plot(moment, y, "o", color="white", markeredgecolor="black")
            axes.text(moment, y + 0.25, event, fontsize=8)
    axes.text(goal["result"], y, "  PREEMPTED after %.1f ms" % (1e3 * (goal["result"] - stop)), va="center")
