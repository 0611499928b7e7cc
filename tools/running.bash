# shellcheck shell=bash
# Running things so that Ctrl-C, kill and a closed terminal leave nothing behind. To be sourced.

sudo=() # what makes a command root's
ended=  # the process group that ran last, once nothing of it is left; another one in $! is still at it

# Runs a command in a process group of its own until nothing of the group is left.
run() {
    local status
    set -m
    "$@" < /dev/null &
    set +m
    wait $!
    status=$?
    while group_runs; do sleep 0.05; done
    ended=$!
    return "$status"
}

group_runs() { kill -0 -- -$! 2> /dev/null; }

# interrupt STATUS: a signal, from the terminal or to us alone, goes on to the group, and ends us once that has ended.
# Whoever ignores it is asked harder every 10 s.
interrupt() {
    local signal tenths
    [[ ${!-} != "$ended" ]] || exit "$1"
    trap '' HUP INT TERM
    say 'stopping …'
    for signal in INT TERM KILL; do
        kill -s "$signal" -- -$! 2> /dev/null
        # What sudo started belongs to root, and only root may signal it.
        ((!${#sudo[@]})) || "${sudo[@]}" kill -s "$signal" -- -$! 2> /dev/null
        for ((tenths = 0; tenths < 100; tenths++)); do
            group_runs || exit "$1"
            sleep 0.1
        done
    done
    exit "$1"
}
trap 'interrupt 129' HUP
trap 'interrupt 130' INT
trap 'interrupt 143' TERM

# For what reads a pipe: the writer stops on the same signal, and may still say its last words.
to_the_end() {
    trap '' HUP INT TERM
    "$@"
}

# logged LOG COMMAND…: the command's output goes to a log, and every five seconds we say how far it is.
logged() {
    # shellcheck disable=SC2094 # a log is read while it grows
    "${@:2}" 2>&1 | { to_the_end cat > "$1"; } | to_the_end progress "$1"
}

# progress LOG: says the log's last line that tells a reader something, until the pipe is closed in which nothing comes.
progress() {
    local last begun=$SECONDS telling='^(Get:[0-9]+ |Unpacking |Setting up |\[ *[0-9]+%\] (Generating|Building) )'
    until read -r -t 5 || (($? <= 128)); do # above 128: five seconds have passed
        last=$(grep -aE "$telling" "$1" | tail -n 1)
        say "    $((SECONDS - begun)) s${last:+: ${last:0:90}}"
    done
}
