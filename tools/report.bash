# shellcheck shell=bash
# How the tools tell what holds and what does not, and count it. To be sourced.

passed=0
failed=0
said=/dev/null # where check puts what a command says: a file that the tool names

# report STATUS WHAT [FILE…]: one line; and what the files say, where it failed.
report() {
    if (($1 == 0)); then
        passed=$((passed + 1))
        echo "ok: $2"
    else
        failed=$((failed + 1))
        echo "FAILED: $2"
        (($# < 3)) || tail -n 100 "${@:3}" | sed 's/^/    /'
    fi
    return "$1"
}

# check WHAT COMMAND…: what the command says is shown if it failed.
check() {
    "${@:2}" > "$said" 2>&1
    report $? "$1" "$said"
}

wait_for() { # wait_for SECONDS COMMAND…
    local end=$((SECONDS + $1))
    until "${@:2}"; do
        ((SECONDS < end)) || return
        sleep 0.05
    done
} > /dev/null 2>&1

finish() {
    echo "$passed passed, $failed failed"
    ((!failed))
}

skip() {
    echo "skipped: $*"
    finish
    exit
}
