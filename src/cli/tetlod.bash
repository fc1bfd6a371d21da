# SPDX-License-Identifier: BSD-3-Clause
# bash completion: commands, and their options, as `tetlod help` says them
_tetlod() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} program=${COMP_WORDS[0]}
    if [ "$COMP_CWORD" = 1 ] || { [ "$COMP_CWORD" = 2 ] && [ "$before" = help ]; }; then
        mapfile -t COMPREPLY < <(compgen -W "help $("$program" help 2>/dev/null | sed -n 's/^  \([a-z]\{1,\}\)  *[^ ].*/\1/p')" -- "$word")
        return
    fi
    case $before in
    --measure) mapfile -t COMPREPLY < <(compgen -W 'max sampled rms predicted' -- "$word") ;;
    --certify) mapfile -t COMPREPLY < <(compgen -W 'fast exact' -- "$word") ;;
    --contract) mapfile -t COMPREPLY < <(compgen -W 'edge face tet hybrid' -- "$word") ;;
    --for) mapfile -t COMPREPLY < <(compgen -W 'mail' -- "$word") ;;
    *)
        case $word in
        -*) mapfile -t COMPREPLY < <(compgen -W "$("$program" help "${COMP_WORDS[1]}" 2>/dev/null | grep -o -- '--[a-z][a-z0-9-]*' | sort -u)" -- "$word") ;;
        *) mapfile -t COMPREPLY < <(compgen -f -- "$word") ;;
        esac
        ;;
    esac
}
complete -o filenames -F _tetlod tetlod
