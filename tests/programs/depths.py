"""Depths: counts gates between the registers of a netlist that Yosys wrote (write_json, flat).

    depths.py NETLIST.json TOP [LOOP.txt]
    depths.py NETLIST.json TOP --why

Prints three numbers: gates of the critical path; gates per register of the longest loop; and gates
of the longest path from an input to s_ready (- if there is none). Inverters are not counted. Gates
per register of a loop is the depth after its registers were moved so that they divide it evenly:
moving registers does not change their number in a loop. Logic outside loops can be divided by as
many registers as there are cycles for it.

LOOP.txt receives the names of the gates in loops, one per line, for Yosys's `select -read`. Gates
of a chain of registers, each of which takes the value of the register before it, are left out,
because they have spare registers. --why prints what the longest loop goes through.
"""

import json
import sys
from collections import defaultdict


def is_register(cell):
    return "DFF" in cell["type"] or "DLATCH" in cell["type"]


def components(nodes, readers):
    """Strong component of each node of a graph (Tarjan's, without recursion), and their sizes."""
    index, low, waiting, stack, of, sizes = {}, {}, set(), [], {}, []
    for root in nodes:
        if root in index:
            continue
        work = [(root, iter(readers[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        waiting.add(root)
        while work:
            node, rest = work[-1]
            for after in rest:
                if after not in index:
                    index[after] = low[after] = len(index)
                    stack.append(after)
                    waiting.add(after)
                    work.append((after, iter(readers[after])))
                    break
                if after in waiting:
                    low[node] = min(low[node], index[after])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    members = stack[stack.index(node):]
                    del stack[len(stack) - len(members):]
                    waiting.difference_update(members)
                    of.update(dict.fromkeys(members, len(sizes)))
                    sizes.append(len(members))
    return of, sizes


def main():
    with open(sys.argv[1]) as file:
        module = json.load(file)["modules"][sys.argv[2]]
    cells, ports = module["cells"], module["ports"]
    inputs, outputs = {}, {}
    for name, cell in cells.items():
        clock = "C" if is_register(cell) else None
        bits = {"input": [], "output": []}
        for port, of in cell["connections"].items():
            if port != clock:
                bits[cell["port_directions"][port]] += [bit for bit in of if isinstance(bit, int)]
        inputs[name], outputs[name] = bits["input"], bits["output"]
    driver = {bit: name for name in cells for bit in outputs[name]}
    registers = [name for name in cells if is_register(cells[name])]
    gates = {name for name in cells if not is_register(cells[name])}
    weight = {name: 0 if cells[name]["type"] in ("$_NOT_", "$_BUF_") else 1 for name in gates}
    before = {name: [driver[bit] for bit in inputs[name] if bit in driver] for name in cells}
    readers = defaultdict(list)
    for name in cells:
        for at in before[name]:
            readers[at].append(name)

    # Gates in topological order.
    waits = {name: sum(1 for at in before[name] if at in gates) for name in gates}
    order = [name for name in gates if waits[name] == 0]
    for name in order:
        for after in readers[name]:
            if after in gates:
                waits[after] -= 1
                if waits[after] == 0:
                    order.append(after)
    if len(order) != len(gates):
        sys.exit(f"depths.py: {sys.argv[2]} has a loop of gates without a register")

    def of_port(direction):
        return {bit for port in ports.values() if port["direction"] == direction for bit in port["bits"] if isinstance(bit, int)}

    # Gates up to the output of each gate: over all paths, and over those that begin at an input.
    from_all, from_inputs = {}, {}
    for name in order:
        from_all[name] = weight[name] + max((from_all[at] for at in before[name] if at in gates), default=0)
    given = of_port("input")
    for name in order:
        begins = [0] if given.intersection(inputs[name]) else []
        depths = [from_inputs[at] for at in before[name] if at in from_inputs] + begins
        if depths:
            from_inputs[name] = weight[name] + max(depths)
    ends = [at for name in registers for at in before[name]] + [driver[bit] for bit in of_port("output") if bit in driver]
    way = max((from_all[at] for at in ends if at in gates), default=0)
    ready = "-"
    if "s_ready" in ports:
        ready = max((from_inputs.get(driver[bit], 0) for bit in ports["s_ready"]["bits"] if bit in driver), default=0)

    # The longest loop: as long as a loop has more gates per register than the limit, the limit is
    # raised to that of this loop.
    sequence = order + registers

    def longer(limit):
        depth, come = dict.fromkeys(cells, 0.0), dict.fromkeys(cells)
        while True:
            changed = False
            for name in sequence:
                own = weight[name] if name in gates else -limit
                for at in before[name]:
                    if depth[at] + own > depth[name] + 1e-6:
                        depth[name], come[name], changed = depth[at] + own, at, True
            if not changed:
                return None
            # The chain of predecessors that increased a depth leads around a loop, if there is one.
            seen = {}
            for start in registers:
                at = start
                while at is not None and at not in seen:
                    seen[at] = start
                    at = come[at]
                if at is not None and seen[at] == start:
                    loop = [at]
                    while come[loop[-1]] != at:
                        loop.append(come[loop[-1]])
                    return loop

    limit, longest = 0.0, []
    while (found := longer(limit)) is not None:
        longest = found
        limit = sum(weight[name] for name in found if name in gates) / sum(1 for name in found if name not in gates)
    print(way, f"{limit:.1f}".removesuffix(".0"), ready)

    if sys.argv[3:] == ["--why"]:
        names = {}
        for net, of in module["netnames"].items():
            for place, bit in enumerate(of["bits"]):
                if bit not in names or len(names[bit]) > len(net):
                    names[bit] = f"{net}[{place}]"
        for name in reversed(longest):
            print(cells[name]["type"], *(names.get(bit) for bit in outputs[name]))
    elif sys.argv[3:]:
        chained = {name for name in registers if all(bit in driver and driver[bit] not in gates
                                                     for bit in cells[name]["connections"]["D"] if isinstance(bit, int))}
        cut = {name: [after for after in readers[name] if name in gates or after not in chained] for name in cells}
        of, sizes = components(list(cells), cut)
        with open(sys.argv[3], "w") as file:
            file.writelines(f"{sys.argv[2]}/{name}\n" for name in order if sizes[of[name]] > 1)


main()
