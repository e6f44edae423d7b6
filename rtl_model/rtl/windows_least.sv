// Windows_least: the least of the valid words, the first one of equals. A tree of pairwise
// comparisons.
//
// Loss: none.
`timescale 1ns / 1ps
`default_nettype none

module windows_least #(
    parameter int N = 1, // words
    parameter int W = 1  // bits of a word
) (
    input wire [N-1:0] counts,  // valid words
    input wire [N*W-1:0] words, // the first in the lowest bits
    output wire [N-1:0] least   // one-hot, or zero if no word is valid
);
  function automatic [N-1:0] least_of(input [N-1:0] counting, input [N*W-1:0] all);
    integer at, step;
    reg [N-1:0] any;
    reg [N*W-1:0] left;
    reg [N*N-1:0] which;
    begin
      any = counting;
      left = all;
      for (at = 0; at < N; at = at + 1) which[at*N+:N] = counting[at] ? N'(1) << at : '0;
      for (step = 1; step < N; step = 2 * step) begin
        for (at = 0; at + step < N; at = at + 2 * step) begin
          if (any[at+step] && (!any[at] || left[(at+step)*W+:W] < left[at*W+:W])) begin
            any[at] = 1'b1;
            left[at*W+:W] = left[(at+step)*W+:W];
            which[at*N+:N] = which[(at+step)*N+:N];
          end
        end
      end
      least_of = which[N-1:0];
    end
  endfunction
  assign least = least_of(counts, words);
endmodule

`default_nettype wire
