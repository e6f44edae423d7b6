// Feeds a trace of splatsim to DRAMsim3: in its order, each request when it is due and there is room. Built by dram.py.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <unordered_map>
#include "memory_system.h"

int main(int argc, char** argv) {
  if (argc != 7) {
    fprintf(stderr, "usage: %s CONFIG FOLDER TRACE NS_OF_A_TRACE_CYCLE(0: as fast as there is room) TCK_NS CHANNELS\n", argv[0]);
    return 2;
  }
  const double of_trace = atof(argv[4]), tck = atof(argv[5]);
  const uint64_t next_column = 64 * strtoull(argv[6], nullptr, 10);
  uint64_t clock = 0, last = 0, pending = 0;
  std::unordered_map<uint64_t, int> under_way;
  auto done = [&](uint64_t address) { pending--, last = clock, under_way.erase(address); };
  dramsim3::MemorySystem memory(argv[1], argv[2], done, done);
  FILE* trace = fopen(argv[3], "r");
  if (!trace) return 2;
  unsigned long long address, due;
  char kind[8];
  auto read = [&] { return fscanf(trace, "%llx %7s %llu", &address, kind, &due) == 3; };
  for (bool is_left = read(); is_left || pending; clock++) {
    while (is_left && clock * tck >= due * of_trace) {
      // DRAMsim3 answers two requests for one address with one burst, the model moves both: the second goes to another column of the row.
      uint64_t at = address;
      for (uint64_t bit = next_column; under_way.count(at); bit *= 2) at = address ^ bit;
      const bool is_write = kind[0] == 'W';
      if (!memory.WillAcceptTransaction(at, is_write)) break;
      under_way[at] = 1, pending++;
      memory.AddTransaction(at, is_write);
      is_left = read();
    }
    memory.ClockTick();
  }
  printf("%.0f\n", last * tck);
}
