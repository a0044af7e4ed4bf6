#!/usr/bin/env bash
# Cameras on a real kernel: Debian's, with its virtual camera (vivid), in QEMU without KVM.
# Root and apt-get: 120 MB for QEMU and the kernel, which is not installed; some two minutes.
#
#     bash tests/view/vivid.sh .venv/bin/python
set -euo pipefail
here=$(cd "$(dirname "$0")/../.." && pwd)
python=$(realpath -s "${1:-$here/.venv/bin/python}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export PATH=$PATH:/usr/sbin:/sbin
apt-get install -qy --no-install-recommends qemu-system-x86 kmod cpio >/dev/null
image=$(apt-cache depends linux-image-amd64 | awk '/Depends: linux-image/ {print $2; exit}')
apt-get download -q "$image" busybox-static >/dev/null 2>&1
for package in *.deb; do dpkg -x "$package" unpacked; done
version=$(ls unpacked/lib/modules)
depmod -b unpacked "$version"

mkdir -p init/{bin,modules,proc,sys,dev,run,lower,root} out
cp unpacked/bin/busybox init/bin
for module in virtio_pci 9pnet_virtio 9p overlay vivid; do
    modprobe -d unpacked -S "$version" --show-depends "$module" | awk '{print $2}'
done | awk '!seen[$0]++' | while read -r file; do
    cp "$file" init/modules
    basename "$file" >>init/order
done
cat >init/init <<INIT
#!/bin/busybox sh
b() { /bin/busybox "\$@"; }
host() { b mount -t 9p -o "trans=virtio,version=9p2000.L,msize=262144\$1" "\$2" "\$3"; }
b mount -t proc proc /proc
b mount -t sysfs sys /sys
b mount -t devtmpfs dev /dev
for module in \$(b cat /order); do
    case \$module in vivid.*) keys="n_devs=1 node_types=0x1" ;; *) keys= ;; esac # one that captures
    b insmod /modules/\$module \$keys
done
b mount -t tmpfs run /run
b mkdir /run/upper /run/work
host ,ro,cache=loose host /lower
b mount -t overlay -o lowerdir=/lower,upperdir=/run/upper,workdir=/run/work overlay /root
host "" out /root$work/out
for tree in proc sys dev; do b mount --move /\$tree /root/\$tree; done
b chroot /root /bin/bash -c 'cd $here && $python -m tests.view.vivid' >/root$work/out/said 2>&1
echo \$? >/root$work/out/status
b sync
b poweroff -f
INIT
chmod +x init/init
(cd init && find . | cpio -o -H newc 2>/dev/null) | gzip -1 >initrd.gz

shared() { echo "-fsdev local,id=$1,path=$2,security_model=none,multidevs=remap$3" \
    "-device virtio-9p-pci,fsdev=$1,mount_tag=$1"; }
# shellcheck disable=SC2046 # words
timeout 600 qemu-system-x86_64 -accel tcg -cpu max -m 2G -nographic -nodefaults -serial stdio \
    -no-reboot -kernel unpacked/boot/vmlinuz-* -initrd initrd.gz \
    -append "console=ttyS0 panic=1 no_timer_check" \
    $(shared host / ,readonly=on) $(shared out "$work/out" "") </dev/null >kernel.log 2>&1 || true
cat out/said 2>/dev/null || tail -n 20 kernel.log
exit "$(cat out/status 2>/dev/null || echo 1)"
