#!/bin/bash
# scripts_test.sh with-vcan|private-network|setup: checks what the scripts promise.
set -u
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
num_failures=0

expect() {  # expect WHAT ACTUAL EXPECTED
  if [ "$2" != "$3" ]; then
    printf 'FAILED: %s\n  is:       %s\n  expected: %s\n' "$1" "$2" "$3"
    num_failures=$((num_failures + 1))
  fi
}

call() {  # call CMD...: status, out and err of it
  "$@" >"$work/out" 2>"$work/err"
  status=$?
  out=$(cat "$work/out")
  err=$(cat "$work/err")
}

check_with_vcan() {
  # shellcheck disable=SC2016  # the inner shell expands it
  call "$root/scripts/with-vcan" bash -c 'for i in lo vcan0 vcan1; do ip -o link show $i up | cut -d" " -f2,4,5; done
    echo "$PWD|$GREETING|$1|$2" >&2; ip -o link | wc -l; exit 7' bash 'a  b' "c'\$d\""
  expect "exit status" "$status" 7
  expect "interfaces" "$out" "$(printf 'lo: mtu 65536\nvcan0: mtu 72\nvcan1: mtu 72\n3')"
  expect "stderr, folder, environment, arguments" "$err" "$PWD|hello|a  b|c'\$d\""
  # A frame goes from one socket to another; what takes many writes comes whole.
  # shellcheck disable=SC2016
  call "$root/scripts/with-vcan" bash -c 'candump -n 1 -L vcan0 | cut -d" " -f2,3 &
    until grep -q "^ *vcan0 " /proc/net/can/rcvlist_all; do :; done
    cansend vcan0 123#DEADBEEF; wait
    head -c 2000000 /dev/zero | tr "\0" x >&2; kill -TERM $$'
  expect "frame" "$out" "vcan0 123#DEADBEEF"
  expect "bytes of stderr" "$(wc -c <"$work/err")" 2000000
  expect "status of a signal" "$status" 143
  call "$root/scripts/with-vcan" "$root/scripts/with-vcan" "$root/scripts/private-network" test -e /sys/class/net/vcan1
  expect "nested" "$status" 0
  # What a command leaves behind does not keep its output open.
  call timeout 60 "$root/scripts/with-vcan" bash -c 'sleep 1000 & setsid sleep 1000 & echo done; echo well >&2; exit 5'
  expect "left behind: status, stdout, stderr" "$status $out $err" "5 done well"
  call "$root/scripts/with-vcan" /no/such/command
  expect "command not found" "$status" 127
  call "$root/scripts/with-vcan"
  expect "no command" "$status" 2
}

check_private_network() {
  # shellcheck disable=SC2016
  call "$root/scripts/private-network" sh -c 'ip -o link | wc -l; echo "$HOLDFAST_NAMESPACE_PID" >&2; echo $$; ip route get 239.1.1.1 | grep -c "dev lo"; exit 9'
  expect "exit status" "$status" 9
  expect "interfaces, process, route" "$out" "$(printf '1\n%s\n1' "$err")"
  # shellcheck disable=SC2016
  call "$root/scripts/private-network" sh -c 'readlink /proc/self/ns/net; exec "$1" readlink /proc/self/ns/net' sh "$root/scripts/private-network"
  expect "nested is the same network" "$(sort -u "$work/out" | wc -l)" 1
  # A process that is gone is not believed.
  HOLDFAST_NAMESPACE_PID=999999999 call "$root/scripts/private-network" readlink /proc/self/ns/net
  expect "a new network" "$([ "$out" = "$(readlink /proc/self/ns/net)" ] && echo old || echo new)" new
}

check_setup() {
  call "$root/scripts/setup" --test
  expect "nothing to do: status" "$status" 0
  expect "nothing to do: silence" "$out$err" ""
  call "$root/scripts/setup" --nonsense
  expect "wrong use" "$status" 2
  # Without apt it names the packages.
  mkdir "$work/bin"
  for tool in bash cat command id dirname mktemp rm; do
    [ -x "/usr/bin/$tool" ] && ln -s "/usr/bin/$tool" "$work/bin/$tool"
  done
  call env PATH="$work/bin" bash "$root/scripts/setup"
  expect "no apt: status" "$status" 1
  expect "no apt: names the packages" "$(grep -c 'liblcm-dev' "$work/err")" 1
}

export GREETING=hello
case ${1:-} in
  with-vcan) check_with_vcan ;;
  private-network) check_private_network ;;
  setup) check_setup ;;
  *) echo "usage: scripts_test.sh with-vcan|private-network|setup" >&2; exit 2 ;;
esac
[ "$num_failures" = 0 ] || exit 1
echo "fine"
